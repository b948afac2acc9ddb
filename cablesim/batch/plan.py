"""Which result goes where, checked before anything runs.

Depends on: files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cablesim.files import OutputError, check_writable


@dataclass(frozen=True)
class Run:
    """One case, the file its result goes to, and what is changed in it (``key=value``)."""

    case: Path
    file: Path
    overrides: tuple[str, ...] = ()


def plan_runs(
    paths: Sequence[str | Path], output: str | Path = ".", overrides: Sequence[str] = ()
) -> list[Run]:
    """Decide where each result goes, and check before anything runs that it can be written there.

    Parameters
    ----------
    paths : sequence of paths
        Case files.
    output : path
        An existing folder, or for a single case a file ending in ``.nc``.
    overrides : sequence of str
        ``key=value``, set in every case.

    Raises
    ------
    OutputError
        If a folder is missing or not writable, or two results would have the same name.
    """
    cases, output = [Path(path) for path in paths], Path(output)
    if output.suffix == ".nc" and not output.is_dir():
        if len(cases) > 1:
            raise OutputError(f"{output} is one file for {len(cases)} cases. Give a folder with --output.")
        files = [output]
    else:
        files = [output / f"{case.stem}.nc" for case in cases]
    for index, file in enumerate(files):
        if file in files[:index]:
            first = cases[files.index(file)]
            raise OutputError(f"{first} and {cases[index]} would both be written to {file}. Rename one.")
        check_writable(file)
    return [Run(case, file, tuple(overrides)) for case, file in zip(cases, files, strict=True)]
