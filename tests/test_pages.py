"""The pages say what is so: examples run, links lead somewhere, written parts follow from files."""

from __future__ import annotations

import re
from pathlib import Path

import evidence
import pages
import pytest
from common import between

from cablesim.build import build_scene
from cablesim.case import Case

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted(
    file
    for folder in (".", "cases", "cablesim", "validation", "validation/recorded")
    for file in (ROOT / folder).glob("README.md")
)


def blocks(file: Path, language: str) -> list[str]:
    """Texts of the fenced blocks of a page in a language."""
    return re.findall(
        rf"^```{language}\n(.*?)^```", file.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )


@pytest.mark.parametrize("file", PAGES, ids=lambda file: str(file.relative_to(ROOT)))
def test_links_and_pictures_are_there(file: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)\)", file.read_text(encoding="utf-8"))
    missing = [link for link in links if "://" not in link and not (file.parent / link).exists()]
    assert not missing


def test_commands_of_the_readme() -> None:
    commands = "".join(blocks(ROOT / "README.md", "sh"))
    assert (
        "python3 -m venv .venv && .venv/bin/pip install . && .venv/bin/cablesim run cases/round_trip.yaml\n"
        in commands
    )
    assert ".venv/bin/pip install '.[test]' && .venv/bin/pytest\n" in commands


def test_the_case_of_the_readme_can_be_run() -> None:
    (text,) = blocks(ROOT / "README.md", "yaml")
    assert build_scene(Case.from_yaml(text)).name == "first"


@pytest.mark.parametrize(
    "file", [ROOT / "README.md", ROOT / "cablesim" / "README.md"], ids=["root", "cablesim"]
)
def test_python_of_the_pages_runs(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    for text in blocks(file, "python"):
        exec(compile(text, str(file), "exec"), {})


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 130


def test_written_parts_follow_from_files() -> None:
    results = evidence.kept()
    assert between(ROOT / "validation" / "README.md", "results") == evidence.sections(results)
    assert between(ROOT / "README.md", "figures") == evidence.figures(results)
    assert between(ROOT / "cases" / "README.md", "gallery") == pages.gallery()
    assert between(ROOT / "cablesim" / "README.md", "modules") == pages.modules()
