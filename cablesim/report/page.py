"""Fills the page of a report.

Depends on: picture; works on the dataset of a run.
"""

from __future__ import annotations

import json
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import xarray as xr

from cablesim.picture import description, node_positions
from cablesim.plausibility import ATTRIBUTE, warnings_of
from cablesim.report.facts import Fact, key_facts
from cablesim.report.payload import choose_thinning, payload

SCRIPTS = ("run.js", "camera.js", "scene.js", "plot.js", "player.js", "viewer.js")
"""The viewer, in the order in which its parts need one another."""

ELSEWHERE = ("case", ATTRIBUTE)
"""Attributes with a place of their own on the page."""


def write_report(dataset: xr.Dataset, path: str | Path, *, generator: str = "cablesim") -> None:
    """Write a report of a run: one HTML file that needs nothing else.

    Parameters
    ----------
    dataset : Dataset
        Result of a run, with `position`.
    path : path
        File to write.
    generator : str
        What made the page, as the page itself says it to programs.

    Raises
    ------
    PlotError
        If the result holds no time, or no `position`.
    OSError
        If the file cannot be written.
    """
    Path(path).write_text(report_html(dataset, generator=generator), encoding="utf-8")


def report_html(dataset: xr.Dataset, *, generator: str = "cablesim") -> str:
    """Text of the report that `write_report` writes.

    Parameters
    ----------
    dataset : Dataset
        Result of a run, with `position`.
    generator : str
        What made the page, as the page itself says it to programs.

    Raises
    ------
    PlotError
        If the result holds no time, or no `position`.
    """
    node_positions(dataset)  # refuses what cannot be drawn before anything is computed
    thinning = choose_thinning(dataset)
    attributes = {str(name): _text(value) for name, value in dataset.attrs.items()}
    return Template(_asset("template.html")).substitute(
        generator=escape(generator),
        title=escape(attributes.get("title", "cable")),
        status=escape(attributes.get("status", "no status")),
        status_class="good" if attributes.get("status") == "completed" else "bad",
        message=escape(attributes.get("message", "")),
        description=escape(description(dataset)),
        warnings=_warnings_html(warnings_of(dataset)),
        facts="\n".join(map(_fact_html, key_facts(dataset))),
        thinning=escape(thinning.note),
        attributes="\n".join(
            _row_html(name, text) for name, text in attributes.items() if name not in ELSEWHERE
        ),
        case=escape(attributes.get("case") or "The file holds no case text."),
        style=_asset("style.css"),
        script="\n".join(map(_asset, SCRIPTS)),
        payload=_script_safe(payload(dataset, thinning)),
    )


def _asset(name: str) -> str:
    return files("cablesim.report").joinpath(name).read_text(encoding="utf-8")


def _script_safe(data: dict[str, Any]) -> str:
    """JSON in which no name can end the script element that holds it."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


def _fact_html(fact: Fact) -> str:
    numbers = " to ".join(f'<data value="{value!r}">{value:.4g}</data>' for value in fact.values)
    number = f'<span class="number">{numbers} <span class="unit">{fact.unit}</span></span>'
    detail = f'<span class="detail">{escape(fact.detail)}</span>'
    return f"<div><dt>{escape(fact.label)}</dt><dd>{number} {detail}</dd></div>"


def _warnings_html(texts: tuple[str, ...]) -> str:
    if not texts:
        return ""
    items = "".join(f"<li>{escape(text)}</li>" for text in texts)
    return f'<section class="card words" aria-label="Warnings"><h2>Warnings</h2><ul>{items}</ul></section>'


def _text(value: object) -> str:
    """An attribute as people read it, numbers rounded."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _row_html(name: str, text: str) -> str:
    return f'<tr><th scope="row">{escape(name)}</th><td>{escape(text)}</td></tr>'
