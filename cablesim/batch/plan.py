"""Which result goes where, checked before anything runs.

Depends on: files, source.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cablesim.batch.source import case_text, files_read, name_of, read_case, read_once
from cablesim.case import Case, CaseError
from cablesim.files import STANDARD_INPUT, OutputError, Product, check_ending, check_writable, real_path


@dataclass(frozen=True)
class Run:
    """One case, the file its result goes to, and what is changed in it (``key=value``).

    `text` is the case itself where it has been read, as standard input must be; `command` is what is
    done with it.
    """

    case: Path
    file: Path
    overrides: tuple[str, ...] = ()
    text: str | None = None
    command: str = "run"

    def product(self, case: str = "") -> Product:
        """The result, of a case whose whole text is `case`."""
        options = [word for override in self.overrides for word in ("--set", override)]
        source = STANDARD_INPUT if read_once(self.case) else self.case
        return Product.of(self.file, self.command, source, *options, case=case)


def plan_runs(
    paths: Sequence[str | Path],
    output: str | Path = ".",
    overrides: Sequence[str] = (),
    *,
    force: bool = False,
) -> list[Run]:
    """Decide where each result goes, and check before anything runs that nothing is lost by it.

    Parameters
    ----------
    paths : sequence of paths
        Case files; one of them may be ``-``, standard input, whose result has the name of the case.
    output : path
        An existing folder, or for a single case a file ending in ``.nc``.
    overrides : sequence of str
        ``key=value``, set in every case.
    force : bool
        Replace also files that are no earlier results of the same case.

    Raises
    ------
    OutputError
        If a folder is missing or not writable, two results would have the same name, a result would
        replace a file that one of the runs reads, or anything but an earlier result of the same case.
    """
    sources, output = [Path(path) for path in paths], Path(output)
    one_file = output.suffix == ".nc" and not output.is_dir()
    if one_file and len(sources) > 1:
        raise OutputError(f"{output} is one file for {len(sources)} cases. Give a folder with --output.")
    if sources.count(STANDARD_INPUT) > 1:
        raise OutputError("standard input can be read once. Name it (-) once.")
    runs, cases = [], []
    for source in sources:
        text = case_text(source) if read_once(source) else None
        case = _case_if_right(source, overrides, text)
        file = output if one_file else output / f"{_stem(source, case)}.nc"
        runs.append(Run(source, file, tuple(overrides), text))
        cases.append(case)
    _check_names(runs)
    reads: dict[Path, str] = {}
    for run, case in zip(runs, cases, strict=True):
        reads |= _reads(run, case)
    for run, case in zip(runs, cases, strict=True):
        run.product("" if case is None else case.to_yaml()).check(reads, force=force)
    return runs


def plan_statics(source: Path, output: Path, overrides: Sequence[str], *, force: bool = False) -> Run:
    """Check that the rest shape of a case can go to a file, and nothing is lost by it; see `plan_runs`."""
    check_ending(output, (".nc",))
    check_writable(output)
    text = case_text(source)
    case = _case_if_right(source, overrides, text)
    run = Run(source, output, tuple(overrides), text, command="statics")
    run.product("" if case is None else case.to_yaml()).check(_reads(run, case), force=force)
    return run


def _reads(run: Run, case: Case | None) -> dict[Path, str]:
    """Files that a run reads -> the name of its case."""
    files = set() if case is None else files_read(case)
    return dict.fromkeys(files | ({run.case} - {STANDARD_INPUT}), name_of(run.case))


def _case_if_right(source: Path, overrides: Sequence[str], text: str | None) -> Case | None:
    """Read a case; one that is refused will say so when it is its turn to run."""
    try:
        return read_case(source, overrides, text)
    except (CaseError, OSError):
        return None


def _stem(source: Path, case: Case | None) -> str:
    if not read_once(source):
        return source.stem
    return "standard_input" if case is None else case.name.replace("/", "_").replace("\\", "_")


def _check_names(runs: Sequence[Run]) -> None:
    first: dict[Path, Run] = {}
    for run in runs:
        other = first.setdefault(real_path(run.file), run)
        if other is not run:
            both = f"{name_of(other.case)} and {name_of(run.case)}"
            raise OutputError(f"{both} would both be written to {run.file}. Rename one.")
