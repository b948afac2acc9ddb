"""Results that are not whole, hold no numbers or no times; places at a winch; cases nested without end."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from runs import only, result, short_case, with_winch
from typer.testing import CliRunner

from cablesim import Case, CaseError, simulate, write
from cablesim.cli import app
from cablesim.export import ExportError, export_csv, export_vtk
from cablesim.picture import node_positions
from cablesim.plot import PlotError, plot_run
from cablesim.report import report_html
from cablesim.report.facts import key_facts
from cablesim.results import check_whole, material_coordinates, segment_coordinates
from cablesim.saved_state import SavedStateError, read_saved_state
from cablesim.starters import starter_text

COMMANDS = (
    ["plot", "r.nc", "-o", "x.png"],
    ["report", "r.nc", "-o", "x.html"],
    ["animate", "r.nc", "-o", "x.gif"],
    ["export", "r.nc", "-f", "csv", "-o", "x"],
    ["export", "r.nc", "-f", "vtk", "-o", "y"],
    ["imu", "r.nc"],
)
PARTS = {
    "some nodes": (lambda run: run.isel(node=slice(0, 50)), "50 of its nodes and 99 of its segments"),
    "one node": (lambda run: run.isel(node=5), "one of its nodes and 99 of its segments"),
    "some segments": (
        lambda run: run.isel(segment=slice(3, None)),
        "100 of its nodes and 96 of its segments",
    ),
    "one time": (lambda run: run.isel(time=0), "holds no times"),
    "no time": (lambda run: run.isel(time=slice(0, 0)), "holds no times"),
    "backwards": (lambda run: run.isel(time=slice(None, None, -1)), "times of the file do not rise"),
    "two axes": (lambda run: run.isel(axis=[0, 2]), "does not hold the axes x, y, z"),
}


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.mark.parametrize("part", PARTS)
def test_parts_of_results_are_refused_in_words(part):
    select, said = PARTS[part]
    data = select(result("buoys"))
    write(data, "r.nc")
    for command in COMMANDS:
        done = call(*command)
        assert done.exit_code == 3, (command, done.output)
        assert said in done.stderr
    for function, error in (
        (plot_run, PlotError),
        (report_html, PlotError),
        (lambda run: export_csv(run, "x"), ExportError),
        (lambda run: export_vtk(run, "x"), ExportError),
    ):
        with pytest.raises(error, match=said):
            function(data)
    check_whole(result("buoys").isel(time=[3, 5]), PlotError)


@pytest.mark.parametrize("part", ["some nodes", "one node", "some segments", "one time", "no time"])
def test_a_part_of_a_result_starts_no_run(part):
    write(PARTS[part][0](result("buoys")), "r.nc")
    with pytest.raises(SavedStateError, match=r"r\.nc: holds (a part of a cable|no times)"):
        read_saved_state("r.nc", None)
    text = short_case("buoys").replace("shape: equilibrium", "shape: state\n  file: r.nc")
    Path("case.yaml").write_text(text)
    done = call("run", "case.yaml")
    assert done.exit_code == 2
    assert "give a whole result" in done.stderr


def without_numbers(dataset, times):
    """The same run with NaN at these times."""
    for name, variable in dataset.data_vars.items():
        if variable.dtype.kind == "f" and "time" in variable.dims:
            dataset[name].values[times] = np.nan
    return dataset


def test_results_without_a_number_are_not_drawn():
    data = without_numbers(result("buoys"), slice(None))
    write(data, "r.nc")
    for command in COMMANDS[1:3]:
        done = call(*command)
        assert done.exit_code == 3
        assert "no position that is a number" in done.stderr
    assert any("No position of the result is a number" in text for text in texts(plot_run(data)))
    with pytest.raises(PlotError):
        node_positions(data)


def texts(figure):
    figure.draw_without_rendering()
    return [text.get_text() for part in figure.subfigs for axes in part.axes for text in axes.texts]


def test_results_with_numbers_at_some_times_are_drawn_there():
    data = without_numbers(result("buoys"), slice(20, None))
    write(data, "r.nc")
    for command in COMMANDS[:5]:
        assert call(*command).exit_code == 0, command
    shapes = plot_run(data).subfigs[0].axes[0].lines
    drawn = [line for line in shapes if len(line.get_xdata()) == data.sizes["node"]]
    assert drawn
    assert all(np.isfinite(line.get_xdata()).all() for line in drawn)


# Places at a winch ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def reeled():
    """A cable of which half is out, and more goes out."""
    text = starter_text("sway", "reeled.yaml", "reeled").replace("duration: 10 s", "duration: 2 s")
    payout = "{kind: waypoints, waypoints: [[0, 0], [0.5, 0.2], [2, 0.2]]}"
    winch = f"winch: {{deployed_length: 1.83 m, payout: {payout}}}\nsimulation:"
    return simulate(Case.from_yaml(text.replace("simulation:", winch)))


def test_the_outlet_is_where_the_cable_out_ends(reeled):
    deployed = reeled["deployed_length"].values
    s, middle = material_coordinates(reeled), segment_coordinates(reeled)
    there = np.isfinite(reeled["position"].values).all(axis=2)
    np.testing.assert_array_equal(s[:, -1], deployed)
    for index in range(reeled.sizes["time"]):
        nodes = s[index][there[index]]
        assert (np.diff(nodes) > 0).all()
        segments = middle[index][np.isfinite(reeled["tension"].values[index])]
        np.testing.assert_allclose(segments, 0.5 * (nodes[1:] + nodes[:-1]), rtol=1e-6)


def test_places_in_reports_and_tables_are_within_the_cable_out(reeled):
    at = re.compile(r"at ([\d.]+) s, s = ([\d.]+) m")
    facts = {fact.label: at.search(fact.detail) for fact in key_facts(reeled)}
    tension, speed = facts["Tension"], facts["Largest speed of a node"]
    for found in (tension, speed):
        deployed = float(reeled["deployed_length"].sel(time=float(found[1]), method="nearest"))
        assert 0 <= float(found[2]) <= deployed + 1e-3
    export_csv(reeled, "x")
    nodes, segments = pd.read_csv("x/nodes.csv"), pd.read_csv("x/segments.csv")
    last = nodes[nodes["node"] == nodes["node"].max()]
    np.testing.assert_allclose(last["s [m]"], reeled["deployed_length"].values, rtol=1e-12)
    last = segments[segments["segment"] == segments["segment"].max()]
    np.testing.assert_allclose(last["s_segment [m]"], segment_coordinates(reeled)[:, -1], rtol=1e-12)


def test_where_the_outlet_is_unknown_it_is_left_out():
    data = with_winch(result("buoys"))
    known = segment_coordinates(data)
    for kept in (("position", "deployed_length"), ("tension", "deployed_length")):
        np.testing.assert_allclose(segment_coordinates(only(data, *kept)), known, atol=0.051)
    unknown = only(data, "position", "tension")
    assert np.isnan(material_coordinates(unknown)[:, -1]).all()
    assert np.isnan(segment_coordinates(unknown)[:, -1]).all()
    xr.testing.assert_equal(unknown["s"], data["s"])


# Nesting ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("opening", ["[", "{a: ", "- "])
def test_text_that_nests_without_end_is_refused(opening):
    text = "name: " + opening * 20_000 if opening != "- " else opening * 20_000
    with pytest.raises(CaseError, match="nested too deeply"):
        Case.from_yaml(text)
    Path("deep.yaml").write_text(text)
    done = call("run", "deep.yaml")
    assert done.exit_code == 2
    assert "deep.yaml: is not valid YAML: nested too deeply" in done.stderr
    Path("sway.yaml").write_text(short_case("sway"))
    done = call("run", "sway.yaml", "--set", f"name={opening * 20_000}")
    assert done.exit_code == 2
    assert "nested too deeply" in done.stderr
