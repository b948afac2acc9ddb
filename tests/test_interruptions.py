"""Runs that are ended from outside leave what they computed; a worker that dies takes its own case only."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from runs import short_case

from cablesim import read
from cablesim.batch import Outcome, run_many
from cablesim.starters import starter_text

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")

COMMAND = [sys.executable, "-m", "cablesim"]
LAW = """import os, signal, time

def still(measured):
    return 0.0

def says_that_it_runs(measured):
    if measured.time > 5:  # there are outputs by then
        open(f"runs_{os.getpid()}", "w").close()
    return 0.0

def dies(measured):
    os.kill(os.getpid(), signal.SIGKILL)

def leaves(measured):
    os._exit(7)
"""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("laws.py").write_text(LAW)


def on_a_winch(name, law, duration):
    """Write a case that asks a controller of ours every second."""
    text = starter_text("sway", f"{name}.yaml", name)
    payout = f"{{kind: function, period: 1 s, function: 'laws.py:{law}'}}"
    winch = f"winch: {{deployed_length: 2.5 m, maximum_speed: 1, payout: {payout}}}\nsimulation:"
    text = text.replace("simulation:", winch).replace("duration: 10 s", f"duration: {duration} s")
    Path(f"{name}.yaml").write_text(text.replace("interval: 20 ms", "interval: 0.2"))
    return f"{name}.yaml"


def wait_for_runs(count):
    """Wait until so many processes integrate."""
    for _ in range(3000):
        found = [name for name in os.listdir() if name.startswith("runs_")]
        if len(found) == count:
            return [int(name.removeprefix("runs_")) for name in found]
        time.sleep(0.05)
    raise AssertionError(f"{len(found)} of {count} runs have begun")


def heed_all_signals():
    """In a child: whoever runs the tests under nohup has it ignore SIGHUP, and cablesim respects that."""
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL if number != signal.SIGINT else signal.default_int_handler)


def ended_by(number, cases, *options, whole_group=False, running):
    """Start a command, send it a signal when runs go on, and wait for its end."""
    process = subprocess.Popen(
        [*COMMAND, "run", *cases, *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=heed_all_signals,
    )
    try:
        wait_for_runs(running)
        os.killpg(process.pid, number) if whole_group else process.send_signal(number)
        out, err = process.communicate(timeout=60)
    finally:
        if process.poll() is None:  # nothing outlives a test that fails
            os.killpg(process.pid, signal.SIGKILL)
    return process.returncode, out, err


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_signal_leaves_a_readable_result(number):
    case = on_a_winch("long", "says_that_it_runs", 1e5)
    code, out, err = ended_by(number, [case], running=1)
    assert code == 130
    assert re.match(r"long\.yaml: interrupted, [\d.]+ s in ", out)
    assert "what was computed is kept" in err
    assert "Traceback" not in err
    dataset = read("long.nc")
    assert dataset.attrs["status"] == "interrupted"
    assert dataset.sizes["time"] > 1
    assert not [name for name in os.listdir() if ".part" in name]


@pytest.mark.parametrize("pause", [0.0, 0.02, 0.1])
def test_a_key_pressed_twice_costs_no_result(pause):
    case = on_a_winch("long", "says_that_it_runs", 1e5)
    process = subprocess.Popen(
        [*COMMAND, "run", case], stdout=subprocess.PIPE, text=True, preexec_fn=heed_all_signals
    )
    try:
        wait_for_runs(1)
        for _ in range(2):
            process.send_signal(signal.SIGINT)
            time.sleep(pause)
        process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    assert read("long.nc").attrs["status"] == "interrupted"


@pytest.mark.parametrize("whole_group", [True, False])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_leaves_readable_results_of_runs_side_by_side(number, whole_group):
    names = ("one", "two")
    cases = [on_a_winch(name, "says_that_it_runs", 1e5) for name in names]
    code, out, err = ended_by(number, cases, "-j", "2", whole_group=whole_group, running=2)
    assert code == 130
    assert "Traceback" not in err
    for name in names:
        assert f"{name}.yaml: interrupted" in out
        assert read(f"{name}.nc").attrs["status"] == "interrupted"


def test_workers_whose_parent_is_killed_write_and_end():
    cases = [on_a_winch(name, "says_that_it_runs", 1e5) for name in ("one", "two")]
    process = subprocess.Popen([*COMMAND, "run", *cases, "-j", "2"], start_new_session=True)
    workers = wait_for_runs(2)
    process.kill()
    process.wait()
    deadline = time.monotonic() + 60
    while any(map(is_alive, workers)) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(map(is_alive, workers))
    for name in ("one", "two"):
        assert read(f"{name}.nc").attrs["status"] == "interrupted"


def is_alive(pid):
    """Whether a process runs; one that ended and waits to be asked for its exit code does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize(
    ("law", "said"), [("dies", "killed by SIGKILL"), ("leaves", "ended with exit code 7")]
)
def test_a_worker_that_dies_takes_its_own_case_only(law, said):
    cases = [on_a_winch(name, "still", 1) for name in ("a", "b", "c", "d")]
    cases.insert(1, on_a_winch("deadly", law, 1))
    summaries = run_many(cases, jobs=2)
    assert [summary.case.stem for summary in summaries] == ["a", "deadly", "b", "c", "d"]
    assert [summary.outcome for summary in summaries] == [
        Outcome.STOPPED if summary.case.stem == "deadly" else Outcome.COMPLETED for summary in summaries
    ]
    assert summaries[1].status == "worker died"
    assert said in summaries[1].message
    for summary in summaries:
        assert summary.file == (None if summary.case.stem == "deadly" else Path(f"{summary.case.stem}.nc"))


def test_a_log_that_is_watched_says_what_workers_do(caplog):
    Path("one.yaml").write_text(short_case("sway"))
    Path("two.yaml").write_text(short_case("sway"))
    with caplog.at_level("DEBUG", "cablesim"):
        run_many(["one.yaml", "two.yaml"], jobs=2)
    assert [record.message for record in caplog.records if "initial shape by" in record.message]
