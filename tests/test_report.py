"""The report is one file that needs nothing else and shows the numbers of the result."""

import base64
import json
import re
import sys
import time
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from runs import only, result, with_imus, with_winch
from typer.testing import CliRunner

from cablesim import write
from cablesim.cli import app
from cablesim.plot import PlotError
from cablesim.report import payload as payload_module
from cablesim.report import report_html, write_report
from cablesim.report.payload import MOST_NODES, choose_thinning


class Page(HTMLParser):
    """What a browser would find in a report."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.tags, self.facts, self.scripts, self.words = [], {}, [], {}
        self._open, self._label = [], ""
        self.feed(text)
        self.data = json.loads(self.scripts[0])

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self._open.append(tag)
        if tag == "script":
            self.scripts.append("")
        if tag == "data":
            self.facts[self._label].append(float(dict(attributes)["value"]))

    def handle_endtag(self, tag):
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, text):
        tag = self._open[-1] if self._open else ""
        if tag == "script":
            self.scripts[-1] += text
        if tag == "dt":
            self._label = text
            self.facts[text] = []
        self.words[tag] = self.words.get(tag, "") + text

    def array(self, name):
        return decoded(self.data[name])

    def lines(self, title):
        panel = next(panel for panel in self.data["panels"] if panel["title"] == title)
        return {line["label"]: decoded(line["values"]) for line in panel["lines"]}


def decoded(array):
    return np.frombuffer(base64.b64decode(array["data"]), "<f4").reshape(array["shape"])


def single(values):
    return np.asarray(values, dtype=np.float32)


def stretched(dataset, times, nodes):
    """The same shapes at more times, 100 a second, and with more nodes."""
    places = {
        "time": np.arange(times) % dataset.sizes["time"],
        "node": np.linspace(0, dataset.sizes["node"] - 1, nodes).astype(int),
        "segment": np.linspace(0, dataset.sizes["segment"] - 1, nodes - 1).astype(int),
    }
    return dataset.isel(places).assign_coords(time=("time", 0.01 * np.arange(times)))


@pytest.fixture
def buoys():
    return with_imus(result("buoys"), imu_1=4.0, imu_2=6.0)


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


# Self-contained ---------------------------------------------------------------------------------


def test_nothing_is_loaded_from_elsewhere(buoys):
    text = report_html(buoys)
    page = Page(text)
    for tag, attributes in page.tags:
        assert tag not in ("iframe", "img", "object", "embed", "base")
        for name in ("src", "href", "srcset", "action", "data"):
            assert attributes.get(name, "data:,") == "data:,", (tag, attributes)
    assert not re.search(r"https?://|@import|url\(|\bimport\(|\bfetch\(|XMLHttpRequest|WebSocket", text)
    policy = next(a["content"] for _, a in page.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'")


def test_report_needs_no_matplotlib(buoys, monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    write_report(buoys, "run.html")
    assert Path("run.html").read_text(encoding="utf-8").startswith("<!doctype html>")


@pytest.mark.parametrize(
    "nasty", ["</script><script>alert(1)</script>", '"><b>&amp;', "$title ${x} $$", "<!--"]
)
def test_text_of_the_user_stays_text(buoys, nasty):
    plain = Page(report_html(buoys))
    buoys.attrs.update(title=nasty, message=nasty, case=nasty)
    buoys.attrs[nasty] = nasty
    buoys = buoys.assign_coords(attachment=[nasty, "weight"])
    page = Page(report_html(buoys))
    assert page.words["h1"] == nasty
    assert page.words["title"] == nasty
    assert page.words["pre"] == nasty
    assert nasty in page.words["th"]
    assert page.data["bodies"][0]["name"] == nasty
    assert f"{nasty} to weight" in page.facts
    count = [tag for tag, _ in page.tags].count
    assert count("script") == [tag for tag, _ in plain.tags].count("script") == 2
    assert count("b") == 0


# Numbers ----------------------------------------------------------------------------------------


def test_places_and_tensions_are_those_of_the_result(buoys):
    page = Page(report_html(buoys))
    np.testing.assert_array_equal(page.array("time"), single(buoys["time"]))
    np.testing.assert_array_equal(page.array("position"), single(buoys["position"]))
    np.testing.assert_array_equal(page.array("tension"), single(buoys["tension"]))
    np.testing.assert_array_equal(page.array("bodyPosition"), single(buoys["attachment_position"]))
    np.testing.assert_array_equal(page.array("imuPosition")[:, 0], page.array("bodyPosition")[:, 0])
    np.testing.assert_array_equal(page.array("s"), single(buoys["s"]))
    assert page.data["imus"] == ["imu_1", "imu_2"]
    assert [body["kind"] for body in page.data["bodies"]] == ["buoy", "ballast"]
    assert "All 41 states and all" in page.words["p"]


def test_lines_against_time_are_those_of_the_result(buoys):
    page = Page(report_html(buoys))
    np.testing.assert_array_equal(page.array("seriesTime"), single(buoys["time"]))
    np.testing.assert_array_equal(page.lines("Tension")["end A"], single(buoys["end_tension"][:, 0]))
    places = buoys["attachment_position"].values
    gap = np.linalg.norm(places[:, 0] - places[:, 1], axis=1)
    np.testing.assert_array_equal(page.lines("Distance between attachments")["float to weight"], single(gap))
    np.testing.assert_array_equal(page.lines("Energy")["kinetic"], single(buoys["kinetic_energy"]))
    low, high = (decoded(bound) for bound in page.data["profile"]["band"])
    np.testing.assert_array_equal(low, single(buoys["tension"].min("time")))
    np.testing.assert_array_equal(high, single(buoys["tension"].max("time")))


def test_key_numbers_are_exact(buoys):
    facts = Page(report_html(buoys)).facts
    speed = np.linalg.norm(buoys["velocity"].values, axis=2)
    places = buoys["attachment_position"].values
    gap = np.linalg.norm(places[:, 0] - places[:, 1], axis=1)
    assert facts == {
        "Simulated": [float(buoys["time"][-1])],
        "Tension": [float(buoys["tension"].min()), float(buoys["tension"].max())],
        "float to weight": [gap.min(), gap.max()],
        "Largest speed of a node": [speed.max()],
        "Closure error": [float(buoys["closure_error"].max())],
    }


def test_attributes_and_case_are_shown(buoys):
    page = Page(report_html(buoys))
    assert page.words["pre"] == buoys.attrs["case"]
    for name, value in buoys.attrs.items():
        if name != "case":
            assert name in page.words["th"]
            rounded = f"{value:.4g}" if isinstance(value, float) else str(value)
            assert rounded in page.words["td"]
    assert "A tether with a buoy and a ballast between a vehicle" in page.words["p"]


def test_a_run_that_stopped_is_marked(buoys):
    buoys.attrs.update(status="not finite", message="NaN at node 3.")
    page = Page(report_html(buoys))
    assert ("p", {"class": "status bad"}) in page.tags
    assert "not finite" in page.words["p"]
    assert "NaN at node 3." in page.words["p"]


# Size -------------------------------------------------------------------------------------------


def test_24_s_of_a_long_cable_stored_at_100_hz_stay_below_8_mb():
    long = stretched(with_imus(result("buoys"), **{f"imu_{i}": 2.0 * i for i in range(1, 6)}), 2401, 160)
    started = time.perf_counter()
    write_report(long, "long.html")
    assert time.perf_counter() - started < 5
    assert Path("long.html").stat().st_size < 8e6
    page = Page(Path("long.html").read_text(encoding="utf-8"))
    shown = page.array("time")
    index = np.searchsorted(long["time"].values, shown - 1e-4)
    np.testing.assert_array_equal(page.array("position"), single(long["position"][index]))
    np.testing.assert_array_equal(page.lines("Tension")["end A"], single(long["end_tension"][:, 0]))
    assert shown[-1] == single(long["time"][-1])
    assert shown.size == 1201
    assert "every 2nd state of 2401" in page.words["p"]


def test_a_decimated_report_says_so_and_keeps_both_ends(buoys, monkeypatch):
    monkeypatch.setattr(payload_module, "STATE_BYTES", 40_000)
    monkeypatch.setattr(payload_module, "SERIES_BYTES", 1_000)
    monkeypatch.setattr(payload_module, "MOST_NODES", 20)
    thinning = choose_thinning(buoys)
    page = Page(report_html(buoys))
    assert thinning.nodes[[0, -1]].tolist() == [0, buoys.sizes["node"] - 1]
    assert len(thinning.nodes) <= 21
    assert thinning.states[-1] == thinning.series[-1] == buoys.sizes["time"] - 1
    assert set(thinning.states) <= set(thinning.series)
    assert "Decimated to keep this file small" in page.words["p"]
    kept = buoys.isel(time=thinning.states)
    np.testing.assert_array_equal(page.array("position"), single(kept["position"][:, thinning.nodes]))
    segments = [*thinning.nodes[:-2], buoys.sizes["segment"] - 1]
    np.testing.assert_array_equal(page.array("tension"), single(kept["tension"][:, segments]))
    np.testing.assert_array_equal(page.array("profileS"), single(buoys["s_segment"][segments]))
    assert page.facts["Tension"][1] == float(buoys["tension"].max())


def test_very_long_cables_have_fewer_nodes():
    for count in (2, MOST_NODES, MOST_NODES + 1, 10_001):
        positions = {"position": (("time", "node", "axis"), np.zeros((1, count, 3)))}
        coordinates = {"time": [0.0], "axis": ["x", "y", "z"], "s": ("node", np.arange(count))}
        dataset = xr.Dataset(positions, coordinates)
        nodes = choose_thinning(dataset).nodes
        assert nodes.size == count if count <= MOST_NODES else nodes.size <= MOST_NODES + 1
        assert nodes[-1] == count - 1


# What is not always there -----------------------------------------------------------------------


def test_nodes_on_the_drum(buoys):
    winch = with_winch(buoys)
    page = Page(report_html(winch))
    position, s = page.array("position"), winch["s"].values
    length = winch["deployed_length"].values
    np.testing.assert_array_equal(position, single(winch["position"]))
    assert np.isnan(position[:, :-1][s[:-1] >= length[:, None]]).all()
    np.testing.assert_array_equal(page.array("outlet"), single(length))
    np.testing.assert_array_equal(page.lines("Deployed length")["deployed length"], single(length))
    np.testing.assert_array_equal(page.lines("Payout")["payout"], single(winch["payout_speed"]))
    assert page.facts["Deployed length"] == [length.min(), length.max()]
    assert page.facts["Tension"] == [float(winch["tension"].min()), float(winch["tension"].max())]
    assert page.array("profileS").size == winch.sizes["segment"] - 1


def test_a_single_state(buoys):
    page = Page(report_html(buoys.isel(time=[0])))
    assert page.array("position").shape[0] == 1
    assert len(page.facts["float to weight"]) == 1


@pytest.mark.parametrize(
    "name", ["tension", "end_tension", "attachment_position", "velocity", "kinetic_energy"]
)
def test_a_missing_variable_leaves_the_rest(buoys, name):
    page = Page(report_html(buoys.drop_vars(name)))
    np.testing.assert_array_equal(page.array("position"), single(buoys["position"]))


def test_missing_variables_are_named(buoys):
    page = Page(report_html(only(buoys, "position")))
    notes = [panel["note"] for panel in [*page.data["panels"], page.data["profile"]]]
    for name in ("end_tension", "attachment_position", "kinetic_energy", "tension"):
        assert any(f"no `{name}`: add it to output.variables" in note for note in notes)
    assert list(page.facts) == ["Simulated"]


def test_without_positions_there_is_no_report(buoys):
    with pytest.raises(PlotError, match="no `position`: add it to output"):
        report_html(buoys.drop_vars("position"))


def test_a_transposed_dataset_is_the_same_report(buoys):
    turned = buoys.transpose("axis", "end", "attachment", "marker", "segment", "node", "time")
    assert report_html(turned) == report_html(buoys)


# Command ----------------------------------------------------------------------------------------


def test_command_writes_the_report(buoys):
    write(buoys, "run.nc")
    done = call("report", "run.nc")
    assert done.exit_code == 0, done.output
    assert re.fullmatch(r"run\.html written \([\d.]+ MB\); open it in a browser\n", done.stdout)
    assert call("report", "run.nc", "-o", "other.html").exit_code == 0
    assert Path("other.html").read_bytes() == Path("run.html").read_bytes()


def test_help_tells_the_exit_codes():
    for command in ("report", "animate"):
        assert "Exit codes: 0 all completed" in " ".join(call(command, "--help").stdout.split())


def test_command_says_what_is_wrong(buoys):
    write(buoys, "run.nc")
    write(only(buoys, "tension"), "bare.nc")
    Path("text.nc").write_text("hello")
    xr.Dataset({"temperature": ("month", [1.0])}).to_netcdf("foreign.nc")
    for arguments, said in (
        (["run.nc", "-o", "missing/a.html"], "missing does not exist"),
        (["run.nc", "-o", "/proc/a.html"], "cannot write /proc/a.html"),
        (["run.nc", "-o", "a.pdf"], "its name must end in .html"),
        (["missing.nc"], "missing.nc does not exist"),
        (["text.nc"], "text.nc cannot be read as a result"),
        (["foreign.nc"], "is it a result of cablesim?"),
        (["bare.nc"], "no `position`: add it to output.variables"),
    ):
        done = call("report", *arguments)
        assert done.exit_code == 3, arguments
        assert said in done.stderr
        assert "Traceback" not in done.output
