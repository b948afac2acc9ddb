"""Malformed and impossible cases: each message says where, what was received, and what to do."""

from __future__ import annotations

import copy
import math
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cablesim.build import build_scene
from cablesim.case import Case, CaseError, load_case
from cablesim.case.read import read_yaml

GOOD = """\
name: good
gravity: 9.81
water:
  density: 1000 kg/m^3
  current: {kind: uniform, velocity: [0.1, 0, 0]}
cable:
  length: 3 m
  diameter: 5 mm
  mass_per_length: 55 g/m
  axial_stiffness: 10 kN
  bending_stiffness: 0.01 N m^2
mesh:
  segment_length: 5 cm
  refine:
    - {around: float, within: 10 cm, segment_length: 1 cm}
attachments:
  - {kind: buoy, name: float, at: 1 m, mass: 20 g, volume: 60 cm^3}
  - {kind: imu, name: inertial, at: 2 m, mounting: {quaternion: [0, 0, 0, 1]}}
ends:
  a: {motion: fixed, position: [0, 0, 0], clamp: [1, 0, 0]}
  b:
    motion: velocity_waypoints
    position: [1.5, 0, 0]
    waypoints:
      - [0, 0, 0, 0]
      - [0.5, 0, 0.5 m/s, 0]
      - [4 s, 0, 0.5, 0]
initial: {shape: equilibrium}
simulation: {duration: 5 s, max_order: 2}
output: {interval: 20 ms, markers: {count: 16}}
"""

END_A = "a: {motion: fixed, position: [0, 0, 0], clamp: [1, 0, 0]}"
END_B = GOOD[GOOD.index("  b:\n") : GOOD.index("initial:")]
INITIAL = "initial: {shape: equilibrium}"
CURRENT = "{kind: uniform, velocity: [0.1, 0, 0]}"
MARKERS = "initial: {shape: markers, arc: [0, 1.5, 3], positions: [[0, 0, 0], [0.75, 0, -1.2], [1.5, 0, 0]]}"
ROV = """  b:
    motion: rov_waypoints
    position: [1.5, 0, 0]
    channels: [surge, yaw]
    waypoints:
      - [0, 0, 0]
      - [1, 0.2, 20 deg/s]
"""
RECORDED = """  b:
    motion: recorded
    file: end.csv
    time_column: t
"""


def with_winch(payout: str) -> str:
    """The good case with 5 m more of cable on a winch."""
    winch = f"""winch:
  deployed_length: 3 m
  maximum_speed: 0.5 m/s
  maximum_acceleration: 1 m/s^2
  minimum_length: 0.5 m
  payout:
{textwrap.indent(payout, "    ")}"""
    lead = "  - {kind: ballast, name: lead, at: 1.5 m, mass: 9 g, volume: 1 cm^3}\nends:\n"
    return GOOD.replace("length: 3 m", "length: 8 m", 1).replace("ends:\n", lead, 1) + winch


PAYOUTS = {
    "waypoints": """kind: waypoints
waypoints:
  - [0 s, 0 m/s]
  - [0.5 s, 0.25 m/s]
  - [2, 0.25]
""",
    "recorded": """kind: recorded
file: payout.csv
column: length
time_column: t
""",
    "buoy_gap": """kind: buoy_gap
buoys: [float, lead]
gap: 0.25 m
period: 50 ms
delay: 10 ms
proportional: 2 1/s
derivative: 0.5
""",
    "constant_tension": """kind: constant_tension
tension: 2 N
proportional: 5 cm/s/N
integral: 0.1 m/s^2/N
""",
    "constant_length": """kind: constant_length
length: 3.5 m
proportional: 0.5 1/s
""",
    "function": """kind: function
function: mine.py:slack
options: {target: 3}
""",
}
TABLE = PAYOUTS["buoy_gap"].replace("gap: 0.25 m\n", "table: gap.csv\n")


def edited(*edits: tuple[str, str], text: str = GOOD) -> str:
    """A good case with some pieces of text replaced, each of which must be there."""
    for old, new in edits:
        assert old in text, f"the good case has no {old!r}"
        text = text.replace(old, new, 1)
    return text


def refusal(text: str, directory: Path | None = None) -> CaseError:
    """What reading, or else building, the case raises."""
    with pytest.raises(CaseError) as caught:
        build_scene(Case.from_yaml(text, file="case.yaml", directory=directory))
    return caught.value


def line_of(text: str, piece: str) -> int:
    """Line on which a piece of text begins."""
    return text[: text.index(piece)].count("\n") + 1


def test_the_good_case_is_accepted() -> None:
    assert build_scene(Case.from_yaml(GOOD)).name == Case.from_yaml(GOOD).name


# name: (old, new, words in the message; those with a colon in front are the path)
READING = {
    "typo in a key": ("diameter:", "diametr:", "cable.diametr", "'5 mm'", "Did you mean 'diameter'?"),
    "typo in a group": ("mesh:", "mehs:", "mehs", "Did you mean 'mesh'?"),
    "typo in a motion": ("motion: fixed", "motion: fixd", "ends.a.motion", "'fixd'", "'fixed'"),
    "typo in a kind": ("kind: buoy", "kind: bouy", "attachments[0].kind", "'bouy'", "'buoy'"),
    "typo in a shape": ("equilibrium", "equilibrum", "initial.shape", "'equilibrum'", "'equilibrium'"),
    "typo in a current": ("kind: uniform", "kind: unifrom", "water.current.kind", "'unifrom'", "'uniform'"),
    "current by a word": (CURRENT, "strong", "water.current", "'strong'", "none, uniform, profile, map"),
    "typo in a solver": (
        "max_order: 2",
        "linear_solver: bend",
        "simulation.linear_solver",
        "'bend'",
        "Did you mean 'band'?",
    ),
    "key of another motion": (
        "a: {motion: fixed,",
        "a: {motion: fixed, period: 2 s,",
        "ends.a.period",
        "'2 s'",
    ),
    "missing key": ("  diameter: 5 mm\n", "", "cable.diameter", "is missing", "Add `diameter`"),
    "missing group": ("simulation: {duration: 5 s, max_order: 2}\n", "", "simulation", "is missing"),
    "missing motion": ("motion: fixed, ", "", "ends.a", "does not say its `motion`", "rov_waypoints"),
    "missing kind": ("kind: buoy, ", "", "attachments[0]", "does not say its `kind`", "ballast"),
    "missing end": (f"  {END_A}\n", "", "ends.a", "is missing"),
    "empty name": ("name: good", "name: ''", "name", "''", "Give some text"),
    "name that is a number": ("name: good", "name: 7", "name", "7", "Give text"),
    "unknown unit": ("5 mm", "5 mmm", "cable.diameter", "unknown unit 'mmm'", "'5 mmm'", "such as '4 mm'"),
    "unit of another kind": ("5 mm", "5 kg", "cable.diameter", "[mass]", "length [m]", "'5 kg'"),
    "weight for mass": ("55 g/m", "0.5 N/m", "cable.mass_per_length", "'0.5 N/m'", "kg/m"),
    "text without unit": ("5 mm", "'5'", "cable.diameter", "without a unit", "'4 mm'"),
    "unit on a pure number": (
        "axial_stiffness",
        "drag_normal: 1.2 m\n  axial_stiffness",
        "cable.drag_normal",
        "takes no unit",
    ),
    "decimal comma": ("5 mm", "'5,0 mm'", "cable.diameter", "'5,0 mm'", "such as '4 mm'"),
    "words for a number": ("5 mm", "thin", "cable.diameter", "is no length", "'thin'"),
    "list for a number": ("5 mm", "[5]", "cable.diameter", "is no length", "[5]"),
    "true for a number": ("5 mm", "true", "cable.diameter", "is no length", "True"),
    "nothing for a number": ("5 mm", "", "cable.diameter", "is no length", "None"),
    "nan": ("5 mm", ".nan", "cable.diameter", "is not finite", "nan"),
    "infinite": ("10 kN", ".inf", "cable.axial_stiffness", "is not finite", "inf"),
    "infinite by overflow": ("10 kN", "1e999 N", "cable.axial_stiffness", "is not finite", "'1e999 N'"),
    "nan in a waypoint": ("[0.5, 0, 0.5 m/s, 0]", "[0.5, .nan, 0, 0]", "ends.b.waypoints[1][1]", "nan"),
    "nan in a position": ("position: [0, 0, 0]", "position: [0, .nan, 0]", "ends.a.position[1]", "nan"),
    "two coordinates": (
        "position: [0, 0, 0]",
        "position: [0, 0]",
        "ends.a.position",
        "has 2 entries",
        "Give 3",
    ),
    "one coordinate": ("position: [0, 0, 0]", "position: [0]", "ends.a.position", "has 1 entries", "Give 3"),
    "four coordinates": ("position: [0, 0, 0]", "position: [0, 0, 0, 1]", "has 4 entries", "Give 3"),
    "position as number": ("position: [0, 0, 0]", "position: 0", "ends.a.position", "is not a list"),
    "short waypoint": (
        "[0.5, 0, 0.5 m/s, 0]",
        "[0.5, 0, 0]",
        "ends.b.waypoints[1]",
        "has 3 entries",
        "Give 4",
    ),
    "negative diameter": ("5 mm", "-5 mm", "cable.diameter", "must be greater than 0", "'-5 mm'", "above 0"),
    "zero length": ("3 m", "0 m", "cable.length", "must be greater than 0", "'0 m'"),
    "cable lighter than nothing": (
        "55 g/m",
        "-55 g/m",
        "cable.mass_per_length",
        "greater than 0",
        "'-55 g/m'",
    ),
    "negative stiffness": ("10 kN", "-10 kN", "cable.axial_stiffness", "greater than 0", "'-10 kN'"),
    "negative mass": ("20 g", "-20 g", "attachments[0].mass", "less than 0", "'-20 g'"),
    "negative volume": ("60 cm^3", "-60 cm^3", "attachments[0].volume", "less than 0", "'-60 cm^3'"),
    "negative place": ("at: 1 m", "at: -1 m", "attachments[0].at", "less than 0", "'-1 m'"),
    "gravity upwards": ("gravity: 9.81", "gravity: -9.81", "gravity", "less than 0", "-9.81"),
    "negative density": ("1000 kg/m^3", "-1000 kg/m^3", "water.density", "less than 0", "'-1000 kg/m^3'"),
    "no duration": ("5 s", "0 s", "simulation.duration", "greater than 0", "'0 s'"),
    "loose tolerance": ("max_order: 2", "relative_tolerance: 1", "simulation.relative_tolerance", "0.1", "1"),
    "tight tolerance": ("max_order: 2", "relative_tolerance: 1e-12", "relative_tolerance", "1e-10", "1e-12"),
    "order too high": ("max_order: 2", "max_order: 6", "simulation.max_order", "greater than 5", "6"),
    "order too low": ("max_order: 2", "max_order: 0", "simulation.max_order", "less than 1", "0"),
    "order by half": ("max_order: 2", "max_order: 2.5", "simulation.max_order", "whole number", "2.5"),
    "skip by a word": ("max_order: 2", "skip: maybe", "simulation.skip", "true or false", "'maybe'"),
    "two weights": (
        "  axial_stiffness",
        "  wet_weight: 0\n  displaced_section: 1e-5\n  axial_stiffness",
        "`wet_weight` and `displaced_section`",
        "Keep one",
    ),
    "refined around and at": (
        "around: float",
        "around: float, at: 1 m",
        "mesh.refine[0]",
        "`around` and `at`",
    ),
    "refined nowhere": ("around: float, ", "", "mesh.refine[0]", "neither `around` nor `at`"),
    "two mountings": (
        "[0, 0, 0, 1]}",
        "[0, 0, 0, 1], rotation_vector: [0, 0, 1]}",
        "attachments[1].mounting",
        "exclude each other",
    ),
    "two rules for markers": ("count: 16", "count: 16, spacing: 1 m", "output.markers", "exclude each other"),
    "one marker": ("count: 16", "count: 1", "output.markers.count", "less than 2", "1"),
    "marker count": ("count: 16", "count: 1000000", "output.markers.count", "greater than 100000"),
    "absurd number": ("3 m", "1e40 m", "cable.length", "more than 1e+30 m", "'1e40 m'"),
    "list in a row to look for": (
        END_B,
        f"{RECORDED}    where: {{point: [1]}}\n",
        "ends.b.where.point",
        "neither text nor a number",
        "[1]",
    ),
    "key twice": ("gravity: 9.81", "gravity: 9.81\nname: again", "name", "given twice, first on line 1"),
    "no markers": (INITIAL, "initial: {shape: markers}", "initial", "neither `arc` nor `file`"),
    "markers without positions": (
        INITIAL,
        "initial: {shape: markers, arc: [0, 3]}",
        "neither `positions` nor `file`",
    ),
    "markers without arc column": (INITIAL, "initial: {shape: markers, file: x.csv}", "lacks `arc_column`"),
    "unknown channel": (END_B, ROV.replace("yaw]", "yow]"), "ends.b.channels[1]", "'yow'", "'yaw'"),
    "channel twice": (
        END_B,
        ROV.replace("yaw]", "surge]").replace(" deg/s", ""),
        "ends.b",
        "a channel twice",
    ),
    "row without a channel": (
        END_B,
        ROV.replace("[0, 0, 0]", "[0, 0]"),
        "ends.b.waypoints[0]",
        "has 2 columns",
        "3",
    ),
    "speed for a yaw rate": (
        END_B,
        ROV.replace("20 deg/s", "20 m/s"),
        "ends.b.waypoints[1][2]",
        "'20 m/s'",
        "angular rate [rad/s]",
    ),
    "format of a recording": (END_B, f"{RECORDED}    format: xls\n", "ends.b.format", "'xls'", "netcdf"),
    "two kinds of time": (
        END_B,
        f"{RECORDED}    sample_interval: 1 s\n",
        "`time_column` and `sample_interval`",
    ),
}

# name: (edits, words in the message)
BUILDING = {
    "ends too far apart": (
        [("position: [1.5, 0, 0]", "position: [4, 0, 0]")],
        ["ends", "4 m apart", "33.3% strain", "longer cable"],
    ),
    "ends torn apart later": (
        [("duration: 5 s", "duration: 100 s")],
        ["ends", "t = 100 s", "torn at t =", "Shorten the run"],
    ),
    "attachment beyond the cable": (
        [("at: 1 m", "at: 3.5 m")],
        ["attachments[0].at", "'3.5 m'", "beyond the cable, 3 m"],
    ),
    "two equal names": (
        [("name: inertial", "name: float")],
        ["attachments[1].name", "'float'", "its own name"],
    ),
    "two at one place": (
        [("ends:", "  - {kind: ballast, name: lead, at: 1 m, mass: 1 g, volume: 0}\nends:")],
        ["attachments[2].at", "'1 m'", "the place of 'float'"],
    ),
    "quaternion too long": (
        [("[0, 0, 0, 1]}", "[1, 0, 0, 1]}")],
        ["mounting.quaternion", "norm 1.41421", "not 1"],
    ),
    "refined around nothing": (
        [("around: float", "around: flaot")],
        ["mesh.refine[0].around", "'flaot'", "Did you mean 'float'"],
    ),
    "refined beyond the cable": (
        [("around: float", "at: 4 m")],
        ["mesh.refine[0].at", "'4 m'", "beyond the cable"],
    ),
    "coarse refinement": (
        [("1 cm}", "1 dm}")],
        ["mesh.refine[0].segment_length", "'1 dm'", "longer than mesh"],
    ),
    "segment too long": ([("5 cm", "2 m")], ["mesh.segment_length", "'2 m'", "a third of the cable", "1 m"]),
    "too many segments": (
        [("5 cm", "0.01 mm"), ("1 cm}", "0.01 mm}")],
        ["mesh.segment_length", "more than 200000"],
    ),
    "interval longer than the run": (
        [("20 ms", "6 s")],
        ["output.interval", "'6 s'", "longer than the run of 5 s"],
    ),
    "too many states": ([("20 ms", "1e-7 s")], ["output.interval", "'1e-7 s'", "states to keep"]),
    "marker beyond the cable": (
        [("{count: 16}", "[1, 2, 4]")],
        ["output.markers[2]", "4", "beyond the cable, 3 m"],
    ),
    "markers too dense": (
        [("count: 16", "spacing: 1e-6 m")],
        ["output.markers", "3e+06 markers", "more than 100000"],
    ),
    "marker spacing": (
        [("count: 16", "spacing: 4 m")],
        ["output.markers.spacing", "'4 m'", "longer than the cable"],
    ),
    "heavier in water than in air": (
        [("  axial_stiffness", "  wet_weight: 1 N/m\n  axial_stiffness")],
        ["cable.wet_weight", "'1 N/m'", "weight in air, 0.5396 N/m"],
    ),
    "wet weight in vacuum": (
        [
            ("1000 kg/m^3", "0"),
            (CURRENT, "none"),
            ("  axial_stiffness", "  wet_weight: 0\n  axial_stiffness"),
        ],
        ["cable.wet_weight", "no meaning in vacuum", "Leave it out"],
    ),
    "wet weight without gravity": (
        [("gravity: 9.81", "gravity: 0"), ("  axial_stiffness", "  wet_weight: 0.1\n  axial_stiffness")],
        ["cable.wet_weight", "0.1", "without gravity"],
    ),
    "current in vacuum": ([("1000 kg/m^3", "0")], ["water.current", "no current in vacuum"]),
    "profile upside down": (
        [(CURRENT, "{kind: profile, heights: [0, -10], velocities: [[0, 0, 0], [1, 0, 0]]}")],
        ["water.current.heights[1]", "-10", "not above the height before"],
    ),
    "profile of two lengths": (
        [(CURRENT, "{kind: profile, heights: [-10, 0], velocities: [[0, 0, 0]]}")],
        ["water.current.velocities", "1 rows for 2 heights"],
    ),
    "map that is not there": (
        [(CURRENT, "{kind: map, file: nowhere.nc}")],
        ["water.current.file", "'nowhere.nc'", "there is no file"],
    ),
    "free end with a clamp": (
        [("motion: fixed, position: [0, 0, 0]", "motion: free")],
        ["ends.a.clamp", "clamps a free end"],
    ),
    "clamp without bending": (
        [("0.01 N m^2", "0")],
        ["ends.a.clamp", "[1, 0, 0]", "without bending stiffness", "`cable.bending_stiffness`"],
    ),
    "clamp without direction": (
        [("[1, 0, 0]}", "[0, 0, 0]}")],
        ["ends.a.clamp", "has no length", "[1, 0, 0]"],
    ),
    "waypoints out of order": (
        [("[4 s,", "[0.2 s,")],
        ["ends.b.waypoints[2][0]", "'0.2 s'", "before the waypoint above it, 0.5 s"],
    ),
    "late first waypoint": (
        [("[0, 0, 0, 0]\n", "[0.1, 0, 0, 0]\n")],
        ["ends.b.waypoints[0][0]", "0.1", "waypoint at 0 s"],
    ),
    "three waypoints at once": (
        [
            ("[4 s,", "[0, 1, 1, 1]\n      - [0, 1, 1, 1]\n      - [4 s,"),
            ("      - [0.5, 0, 0.5 m/s, 0]\n", ""),
        ],
        ["ends.b.waypoints", "third time"],
    ),
    "yawing for ever": (
        [(END_B, ROV)],
        ["ends.b", "ends 1 s after the start", "run of 5 s", "simulation.duration"],
    ),
    "harmonic too fast": (
        [(END_B, "  b: {motion: harmonic, position: [1.5, 0, 0], amplitude: [0, 0, 1], period: 1e-7}\n")],
        ["ends.b", "harmonic"],
    ),
    "taut but slack": (
        [("equilibrium", "taut")],
        ["initial.shape", "'taut'", "1.5 m apart", "3 m long", "`catenary`"],
    ),
    "taut to the side": (
        [("[1.5, 0, 0]", "[3, 0, 0]"), ("equilibrium", "taut, direction: [0, 1, 0]")],
        ["initial.direction", "[0, 1, 0]", "[1.0, 0.0, 0.0]"],
    ),
    "taut without direction": (
        [(END_B, "  b: {motion: free}\n"), ("equilibrium", "taut")],
        ["initial", "does not say its direction", "Add `direction`"],
    ),
    "catenary with a free end": (
        [(END_B, "  b: {motion: free}\n"), ("equilibrium", "catenary")],
        ["initial.shape", "'catenary'", "one is free"],
    ),
    "catenary of a neutral cable": (
        [("  axial_stiffness", "  wet_weight: 0\n  axial_stiffness"), ("equilibrium", "catenary")],
        ["initial.shape", "neutral cable with slack", "`markers`"],
    ),
    "rest with two free ends": (
        [(END_A, "a: {motion: free}"), (END_B, "  b: {motion: free}\n")],
        ["initial", "both ends are free", "`taut`"],
    ),
    "rest of a free neutral cable": (
        [
            (END_A, "a: {motion: free}"),
            (END_B, "  b: {motion: free}\n"),
            ("mass: 20 g", "mass: 60 g"),
            ("  axial_stiffness", "  wet_weight: 0\n  axial_stiffness"),
        ],
        ["initial", "any shape", "`through`"],
    ),
    "two free ends nowhere": (
        [
            (END_A, "a: {motion: free}"),
            (END_B, "  b: {motion: free}\n"),
            ("equilibrium", "taut, direction: [0, 0, 1]"),
        ],
        ["ends", "none says where it starts", "Add `position`"],
    ),
    "two free ends in two places": (
        [
            (END_A, "a: {motion: free, position: [0, 0, 0]}"),
            (END_B, "  b: {motion: free, position: [0, 0, 1]}\n"),
            ("equilibrium", "taut, direction: [0, 0, 1]"),
        ],
        ["ends.b.position", "[0, 0, 1]", "[0.0, 0.0, 3.0]"],
    ),
    "markers of two lengths": (
        [(INITIAL, MARKERS.replace("1.5, 3]", "3]"))],
        ["initial.positions", "3 rows for 2 values"],
    ),
    "markers out of order": (
        [(INITIAL, MARKERS.replace("[0, 1.5, 3]", "[0, 3, 1.5]"))],
        ["initial.arc", "1.5 m after 3 m"],
    ),
    "markers that stop short": (
        [(INITIAL, MARKERS.replace("1.5, 3]", "1.5, 2.5]"))],
        ["initial.arc", "span 0 to 2.5 m", "0 to 3 m"],
    ),
    "chord longer than its arc": (
        [(INITIAL, MARKERS.replace("-1.2", "-2"))],
        ["initial.arc", "2.136 m apart", "1.5 m of cable"],
    ),
    "markers elsewhere": (
        [(INITIAL, MARKERS.replace("[[0, 0, 0]", "[[0, 1, 0]"))],
        ["initial", "[0.0, 1.0, 0.0]", "1 m from end A", "`origin`"],
    ),
    "marker file that is not there": (
        [(INITIAL, "initial: {shape: markers, file: nowhere.csv, arc_column: s}")],
        ["initial.file", "'nowhere.csv'", "relative to the case file"],
    ),
    "state that is not there": (
        [(INITIAL, "initial: {shape: state, file: nowhere.nc}")],
        ["initial.file", "'nowhere.nc'", "there is no file"],
    ),
}


@pytest.mark.parametrize("name", READING)
def test_refused_when_read(name: str) -> None:
    old, new, *words = READING[name]
    error = refusal(edited((old, new)))
    message = str(error)
    for word in words:
        assert word in message
    assert all(problem.remedy and problem.line and problem.file == "case.yaml" for problem in error.problems)


@pytest.mark.parametrize("name", BUILDING)
def test_refused_before_the_run(name: str) -> None:
    edits, words = BUILDING[name]
    text = edited(*edits)
    Case.from_yaml(text)
    error = refusal(text)
    message = str(error)
    for word in words:
        assert word in message
    assert all(problem.remedy and problem.line and problem.file == "case.yaml" for problem in error.problems)


def test_there_are_enough_of_them() -> None:
    assert len(READING) + len(BUILDING) + len(WINCH_READING) + len(WINCH_BUILDING) >= 120


def test_all_errors_at_once_with_their_lines() -> None:
    text = edited(
        ("5 mm", "5 mmm"),
        ("55 g/m", "-55 g/m"),
        ("kind: buoy", "kind: bouy"),
        ("[0.5, 0, 0.5 m/s, 0]", "[0.5, .nan, 0, 0]"),
        ("max_order: 2", "max_ordr: 2"),
    )
    problems = refusal(text).problems
    assert [problem.path for problem in problems] == [
        "cable.diameter",
        "cable.mass_per_length",
        "attachments[0].kind",
        "ends.b.waypoints[1][1]",
        "simulation.max_ordr",
    ]
    pieces = ["5 mmm", "-55 g/m", "kind: bouy", ".nan", "max_ordr"]
    assert [problem.line for problem in problems] == [line_of(text, piece) for piece in pieces]


def test_all_impossibilities_at_once_with_their_lines() -> None:
    text = edited(
        ("around: float", "around: flaot"),
        ("at: 1 m", "at: 5 m"),
        ("position: [1.5, 0, 0]", "position: [9, 0, 0]"),
        ("20 ms", "1 h"),
    )
    problems = refusal(text).problems
    assert [problem.path for problem in problems] == [
        "mesh.refine[0].around",
        "attachments[0].at",
        "ends",
        "output.interval",
    ]
    pieces = ["flaot", "at: 5 m", "ends:", "1 h"]
    assert [problem.line for problem in problems] == [line_of(text, piece) for piece in pieces]
    assert str(CaseError(problems)).startswith("4 problems:\n- case.yaml:15: mesh.refine[0].around: ")


# Winch ------------------------------------------------------------------------------------------

# name: (payout, old, new, words in the message)
WINCH_READING = {
    "winch without a length": (
        "waypoints",
        "  deployed_length: 3 m\n",
        "",
        "winch.deployed_length",
        "missing",
    ),
    "winch without payout": ("function", PAYOUTS["function"], "", "winch.payout"),
    "typo in the winch": ("waypoints", "maximum_speed", "maximal_speed", "Did you mean 'maximum_speed'?"),
    "typo in the payout": ("buoy_gap", "kind: buoy_gap", "kind: bouy_gap", "winch.payout.kind", "'buoy_gap'"),
    "payout of no kind": ("waypoints", "kind: waypoints", "", "does not say its `kind`", "constant_tension"),
    "key of another payout": ("constant_length", "length: 3.5 m", "length: 3.5 m\n    gap: 1", "payout.gap"),
    "nothing deployed": ("waypoints", "deployed_length: 3 m", "deployed_length: 0", "greater than 0", "0"),
    "negative shortest": (
        "waypoints",
        "0.5 m\n",
        "-0.5 m\n",
        "winch.minimum_length",
        "less than 0",
        "'-0.5 m'",
    ),
    "winch that stands still": ("waypoints", "0.5 m/s", "0 m/s", "winch.maximum_speed", "greater than 0"),
    "acceleration in m/s": ("waypoints", "1 m/s^2", "1 m/s", "maximum_acceleration", "m/s**2", "'1 m/s'"),
    "position for a speed": ("waypoints", "0.25 m/s]", "0.25 m]", "waypoints[1][1]", "'0.25 m'", "speed"),
    "waypoint of three": (
        "waypoints",
        "[2, 0.25]",
        "[2, 0.25, 0]",
        "waypoints[2]",
        "has 3 entries",
        "Give 2",
    ),
    "two times of a recording": (
        "recorded",
        "time_column: t",
        "time_column: t\n    sample_interval: 1",
        "exclude",
    ),
    "no period": ("buoy_gap", "50 ms", "0 ms", "winch.payout.period", "greater than 0", "'0 ms'"),
    "measured in the future": (
        "buoy_gap",
        "10 ms",
        "-10 ms",
        "winch.payout.delay",
        "less than 0",
        "'-10 ms'",
    ),
    "negative gain": ("buoy_gap", "2 1/s", "-2 1/s", "payout.proportional", "less than 0", "'-2 1/s'"),
    "negative damping": ("buoy_gap", "0.5\n", "-0.5\n", "payout.derivative", "less than 0", "-0.5"),
    "gain of another kind": ("constant_tension", "5 cm/s/N", "5 cm/s", "payout.proportional", "m/s/N"),
    "negative integral": ("constant_tension", "0.1 m", "-0.1 m", "payout.integral", "less than 0"),
    "tension at no end": (
        "constant_tension",
        "tension: 2 N",
        "tension: 2 N\n    end: c",
        "payout.end",
        "'c'",
    ),
    "three buoys": (
        "buoy_gap",
        "[float, lead]",
        "[float, lead, x]",
        "payout.buoys",
        "has 3 entries",
        "Give 2",
    ),
    "gap and table": ("buoy_gap", "gap: 0.25 m", "gap: 1\n    table: x.csv", "`gap` and `table`", "Keep one"),
    "neither gap nor table": ("buoy_gap", "gap: 0.25 m", "speed_time: 1 s", "neither `gap` nor `table`"),
    "no gap": ("buoy_gap", "0.25 m", "0 m", "winch.payout.gap", "greater than 0", "'0 m'"),
    "options in a list": ("function", "{target: 3}", "[3]", "payout.options", "group of keys", "[3]"),
}

# name: (payout, edits, words in the message)
WINCH_BUILDING: dict[str, tuple[str, list[tuple[str, str]], list[str]]] = {
    "winch on a free end": (
        "waypoints",
        [(END_B, "  b: {motion: free}\n")],
        ["ends.b.motion", "'free'", "where the winch is"],
    ),
    "more out than there is": (
        "waypoints",
        [("deployed_length: 3 m", "deployed_length: 9 m")],
        ["winch.deployed_length", "'9 m'", "whole cable, 8 m"],
    ),
    "hardly any out": (
        "constant_length",
        [("deployed_length: 3 m", "deployed_length: 12 cm"), ("0.5 m\n", "0.1 m\n")],
        ["winch.deployed_length", "'12 cm'", "shorter than 3 segments of 0.05 m", "0.15 m"],
    ),
    "shorter than it may get": (
        "waypoints",
        [("minimum_length: 0.5 m", "minimum_length: 4 m")],
        ["winch.minimum_length", "'4 m'", "more than winch.deployed_length, 3 m"],
    ),
    "ends apart from what is out": (
        "waypoints",
        [("deployed_length: 3 m", "deployed_length: 1 m")],
        ["1.5 m apart", "a cable of 1 m", "50.0% strain", "`winch.deployed_length`"],
    ),
    "torn while reeled in": (
        "waypoints",
        [("0.25 m/s]", "-0.45 m/s]"), ("[2, 0.25]", "[2, -0.45]"), ("1 m/s^2", "2 m/s^2")],
        ["ends", "would be torn at t =", "Shorten the run"],
    ),
    "torn although all may go out": (
        "constant_length",
        [("duration: 5 s", "duration: 30 s")],
        ["ends", "a cable of 8 m would be torn"],
    ),
    "taut with all its cable": (
        "waypoints",
        [("[1.5, 0, 0]", "[2.5, 0, 0]"), ("equilibrium", "taut")],
        ["initial.shape", "2.5 m apart", "3 m long"],
    ),
    "markers of the whole cable": (
        "waypoints",
        [(INITIAL, MARKERS.replace("1.5, 3]", "1.5, 8]"))],
        ["initial.arc", "0 to 8 m", "0 to 3 m", "`winch.deployed_length`"],
    ),
    "program too fast": (
        "waypoints",
        [("[2, 0.25]", "[2, 0.75 m/s]")],
        ["winch.payout.waypoints[2]", "0.75 m/s at 2 s", "winch.maximum_speed, 0.5 m/s"],
    ),
    "reeling in too fast": (
        "waypoints",
        [("[2, 0.25]", "[4, -0.6]")],
        ["winch.payout.waypoints[2]", "-0.6 m/s at 4 s", "winch.maximum_speed"],
    ),
    "program too sudden": (
        "waypoints",
        [("[0.5 s, 0.25 m/s]", "[0.1 s, 0.25 m/s]")],
        ["winch.payout.waypoints[0]", "2.5 m/s2 at 0 s", "winch.maximum_acceleration, 1 m/s2"],
    ),
    "jump of the speed": (
        "waypoints",
        [("[2, 0.25]", "[0.5, 0.3]")],
        ["winch.payout.waypoints[1]", "a jump of the speed at 0.5 s", "maximum_acceleration"],
    ),
    "late first payout": (
        "waypoints",
        [("[0 s, 0 m/s]", "[0.1 s, 0 m/s]")],
        ["winch.payout.waypoints[0][0]", "'0.1 s'", "waypoint at 0 s"],
    ),
    "payout out of order": (
        "waypoints",
        [("[2, 0.25]", "[0.2, 0.25]")],
        ["winch.payout.waypoints[2][0]", "0.2", "before the waypoint above it, 0.5 s"],
    ),
    "three payouts at once": (
        "waypoints",
        [("[0.5 s, 0.25 m/s]", "[2, 0]\n      - [2, 0.1]")],
        ["winch.payout.waypoints", "third time"],
    ),
    "recorded payout that is not there": (
        "recorded",
        [],
        ["winch.payout.file", "'payout.csv'", "there is no file"],
    ),
    "unknown buoys": (
        "buoy_gap",
        [("[float, lead]", "[flaot, led]")],
        ["winch.payout.buoys[0]", "'flaot'", "'float'", "winch.payout.buoys[1]", "'led'", "'lead'"],
    ),
    "sensor for a buoy": (
        "buoy_gap",
        [("[float, lead]", "[float, inertial]")],
        ["winch.payout.buoys[1]", "'inertial'", "Known here: float, lead"],
    ),
    "one buoy twice": (
        "buoy_gap",
        [("[float, lead]", "[float, float]")],
        ["winch.payout.buoys", "the same buoy twice"],
    ),
    "gap wider than its cable": (
        "buoy_gap",
        [("gap: 0.25 m", "gap: 0.6 m")],
        ["winch.payout.gap", "'0.6 m'", "0.5 m of cable between the buoys"],
    ),
    "table that is not there": (
        "buoy_gap",
        [("gap: 0.25 m", "table: gap.csv")],
        ["winch.payout.table", "'gap.csv'", "there is no file"],
    ),
    "controller asleep": (
        "buoy_gap",
        [("50 ms", "6 s")],
        ["winch.payout.period", "'6 s'", "longer than the run of 5 s"],
    ),
    "controller in a hurry": (
        "constant_length",
        [("length: 3.5 m", "length: 3.5 m\n    period: 1e-8 s")],
        ["winch.payout.period", "'1e-8 s'", "5e+08 samples"],
    ),
    "attachment called like an end": (
        "constant_length",
        [("name: lead", "name: b")],
        ["attachments[2].name", "'b'", "calls an end of the cable"],
    ),
    "length to keep too long": (
        "constant_length",
        [("3.5 m", "9 m")],
        ["winch.payout.length", "'9 m'", "whole cable, 8 m"],
    ),
    "length to keep too short": (
        "constant_length",
        [("3.5 m", "0.4 m")],
        ["winch.payout.length", "'0.4 m'", "winch.minimum_length, 0.5 m"],
    ),
    "function that is not there": (
        "function",
        [],
        ["winch.payout.function", "'mine.py:slack'", "there is no file", "relative to the case file"],
    ),
    "function without a name": (
        "function",
        [("mine.py:slack", "mine.py")],
        ["winch.payout.function", "'mine.py'", "Write file.py:name"],
    ),
    "module that is not there": (
        "function",
        [("mine.py:slack", "no_such_package.laws:slack")],
        ["winch.payout.function", "there is no module no_such_package.laws", "Name a file"],
    ),
    "name in the standard library": (
        "function",
        [("mine.py:slack", "math:sqrt")],
        ["winch.payout.function", "math is of Python's standard library", "name its file"],
    ),
}


@pytest.mark.parametrize("name", WINCH_READING)
def test_winch_refused_when_read(name: str) -> None:
    payout, old, new, *words = WINCH_READING[name]
    text = with_winch(PAYOUTS[payout])
    error = refusal(replaced_last(text, old if old in text else textwrap.indent(old, "    "), new))
    message = str(error)
    for word in words:
        assert word in message
    assert all(problem.remedy and problem.line and problem.file == "case.yaml" for problem in error.problems)


def replaced_last(text: str, old: str, new: str) -> str:
    """Replace the last of several equal pieces: the winch stands at the end."""
    before, found, after = text.rpartition(old)
    assert found, f"the case has no {old!r}"
    return before + new + after


@pytest.mark.parametrize("name", WINCH_BUILDING)
def test_winch_refused_before_the_run(name: str, tmp_path: Path) -> None:
    payout, edits, words = WINCH_BUILDING[name]
    text = edited(*edits, text=with_winch(PAYOUTS[payout]))
    Case.from_yaml(text)
    error = refusal(text, tmp_path)
    message = str(error)
    for word in words:
        assert word in message
    assert all(problem.remedy and problem.line and problem.file == "case.yaml" for problem in error.problems)


def write_payout(path: Path, *, first: float = 3.0, last: float = 6.0, scale: float = 1.0) -> None:
    times = np.linspace(0.0, last, 61)
    rows = [f"{t:.3f},{scale * (first + 0.2 * (t - np.sin(t))):.5f}" for t in times]
    path.write_text("\n".join(["t,length", *rows]))


def test_good_winches_are_accepted(tmp_path: Path) -> None:
    write_payout(tmp_path / "payout.csv")
    (tmp_path / "gap.csv").write_text("speed,gap\n0,0.2\n0.5,0.3\n")
    (tmp_path / "mine.py").write_text("def slack(measured, target):\n    return 0.0\n")
    for payout in (*PAYOUTS.values(), TABLE):
        winch = build_scene(Case.from_yaml(with_winch(payout), directory=tmp_path)).winch
        assert winch is not None
        assert winch.deployed_length == 3.0


@pytest.mark.parametrize(
    ("options", "edits", "words"),
    [
        ({"last": 4.0}, [], ["winch.payout.file", "the recording ends 4 s after", "before the run of 5 s"]),
        ({"first": 3.2}, [], ["winch.deployed_length", "'3 m'", "begins with, 3.19", "Give 3.19"]),
        ({"scale": 1000.0}, [], ["winch.deployed_length", "3000 m"]),
        ({}, [("column: length", "column: lenght")], ["no column 'lenght'", "Did you mean 'length'?"]),
        ({}, [("column: length", "unit: kg")], ["winch.payout.unit", "no unit of length", "'kg'"]),
        ({}, [("time_column: t", "start: 9 s\n    time_column: t")], ["start is 9 s", "within it"]),
        (
            {},
            [("    time_column: t\n", "")],
            ["winch.payout.file", "neither of time_column and sample_interval"],
        ),
        ({}, [("speed: 0.5 m/s", "speed: 0.3 m/s")], ["winch.payout.file", " at 3.1", "maximum_speed, 0.3"]),
        ({}, [("1 m/s^2", "0.1 m/s^2")], ["winch.payout.file", "m/s2 at", "maximum_acceleration, 0.1"]),
    ],
)
def test_recorded_payouts_that_do_not_fit(
    tmp_path: Path, options: dict[str, float], edits: list[tuple[str, str]], words: list[str]
) -> None:
    write_payout(tmp_path / "payout.csv", **options)
    message = str(refusal(edited(*edits, text=with_winch(PAYOUTS["recorded"])), tmp_path))
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("speed,gap\n", ["has no rows"]),
        ("speed,distance\n0,0.2\n", ["no column 'gap'", "speed, distance"]),
        ("speed,gap\n0,0.2\n0,0.3\n", ["a speed of 0 m/s after 0 m/s", "Sort the rows"]),
        ("speed,gap\n0,0.2\n1,nan\n", ["line 3", "'nan' is not a finite number"]),
        ("speed,gap\n0,0.2\n1,\n", ["line 3", "'' is not a finite number"]),
        ("speed,gap\n0,0.2\n1,-0.1\n", ["a gap of -0.1 m at 1 m/s", "above 0 m"]),
        ("speed,gap\n0,0.2\n1,0.7\n", ["a gap of 0.7 m with 0.5 m of cable"]),
    ],
)
def test_tables_of_gaps_that_are_none(tmp_path: Path, rows: str, words: list[str]) -> None:
    (tmp_path / "gap.csv").write_text(rows)
    message = str(refusal(with_winch(TABLE), tmp_path))
    assert "winch.payout.table" in message
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("def slak(measured, target):\n    return 0.0\n", ["has no slack", "Did you mean 'slak'?"]),
        ("slack = 1.0\n", ["is no function but 1.0"]),
        ("def slack(measured):\n    return 0.0\n", ["takes (measured)", "given (the measurement, target)"]),
        (
            "class slack:\n    def __init__(self, aim): pass\n    def __call__(self, measured): return 0.0\n",
            ["takes (aim)", "would be given (target)"],
        ),
        ("class slack:\n    def __init__(self, target): pass\n", ["instances", "cannot be called"]),
    ],
)
def test_functions_that_are_no_controllers(tmp_path: Path, code: str, words: list[str]) -> None:
    (tmp_path / "mine.py").write_text(code)
    message = str(refusal(with_winch(PAYOUTS["function"]), tmp_path))
    assert "winch.payout.function" in message
    assert "received 'mine.py:slack'" in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("speed", [-0.5, 0.5])
def test_a_program_that_leaves_its_cable_is_no_mistake(speed: float) -> None:
    """The run stops there; what the ends do after that does not count."""
    payout = f"kind: waypoints\nwaypoints:\n  - [0, {speed}]\n"
    text = edited(
        ("duration: 5 s", "duration: 60 s"),
        ("[1.5, 0, 0]", "[0.3, 0, 0]"),
        ("- [4 s, 0, 0.5, 0]", "- [10 s, 0, 0, 0]\n      - [11 s, 0, 0, 0]\n      - [12 s, 0, 9 m/s, 0]"),
        ("[0.5, 0, 0.5 m/s, 0]", "[0.5, 0, 0, 0]"),
        text=with_winch(payout),
    )
    assert build_scene(Case.from_yaml(text)).winch is not None


def test_everything_wrong_with_a_winch_is_said_at_once() -> None:
    text = edited(
        ("deployed_length: 3 m", "deployed_length: 9 m"),
        ("minimum_length: 0.5 m", "minimum_length: 10 m"),
        ("50 ms", "1 h"),
        ("[float, lead]", "[float, led]"),
        ("name: inertial", "name: a"),
        text=with_winch(PAYOUTS["buoy_gap"]),
    )
    problems = refusal(text).problems
    assert [problem.path for problem in problems] == [
        "attachments[1].name",
        "winch.deployed_length",
        "winch.minimum_length",
        "winch.payout.buoys[1]",
        "winch.payout.period",
    ]
    pieces = ["name: a,", "9 m", "10 m", "led]", "1 h"]
    assert [problem.line for problem in problems] == [line_of(text, piece) for piece in pieces]


# Files ------------------------------------------------------------------------------------------


def write_recording(path: Path, *, last: float = 6.0, bad_row: str | None = None) -> None:
    times = np.linspace(0.0, last, 61)
    rows = [f"{t:.3f},{1.5 + 0.1 * np.sin(t):.4f},0,0" for t in times]
    if bad_row is not None:
        rows[30] = bad_row
    path.write_text("\n".join(["t,x,y,z", *rows]))


def test_a_recording_is_accepted(tmp_path: Path) -> None:
    write_recording(tmp_path / "end.csv")
    motion = build_scene(Case.from_yaml(edited((END_B, RECORDED)), directory=tmp_path)).end_b.motion
    assert motion is not None
    assert motion.position(1.0)[0] == pytest.approx(1.5 + 0.1 * np.sin(1.0), abs=2e-3)


def test_recording_shorter_than_the_run(tmp_path: Path) -> None:
    write_recording(tmp_path / "end.csv", last=4.0)
    message = str(refusal(edited((END_B, RECORDED)), tmp_path))
    assert "the recording ends 4 s after the start, before the run of 5 s" in message
    assert "simulation.duration" in message


def test_recording_with_nan(tmp_path: Path) -> None:
    write_recording(tmp_path / "end.csv", bad_row="3.0,nan,0,0")
    message = str(refusal(edited((END_B, RECORDED)), tmp_path))
    assert "ends.b.file" in message
    assert "line 32" in message
    assert "nan" in message


def test_recording_that_is_not_there(tmp_path: Path) -> None:
    write_recording(tmp_path / "ends.csv")
    message = str(refusal(edited((END_B, RECORDED)), tmp_path))
    assert "ends.b.file" in message
    assert "Did you mean 'ends.csv'?" in message


def test_recording_without_the_column(tmp_path: Path) -> None:
    write_recording(tmp_path / "end.csv")
    text = edited((END_B, f"{RECORDED}    columns: [x, y, height]\n"))
    message = str(refusal(text, tmp_path))
    assert "ends.b.file" in message
    assert "height" in message


def test_recording_in_furlongs_of_mass(tmp_path: Path) -> None:
    write_recording(tmp_path / "end.csv")
    message = str(refusal(edited((END_B, f"{RECORDED}    unit: kg\n")), tmp_path))
    assert "ends.b.unit: is no unit of length; received 'kg'" in message


def test_recording_that_starts_too_late(tmp_path: Path) -> None:
    write_recording(tmp_path / "end.csv")
    message = str(refusal(edited((END_B, f"{RECORDED}    start: 60 s\n")), tmp_path))
    assert "start is 60 s" in message
    assert "within it" in message


def test_recording_without_a_vertical(tmp_path: Path) -> None:
    write_recording(tmp_path / "end.csv")
    message = str(refusal(edited((END_B, f"{RECORDED}    up: [0, 0, 0]\n")), tmp_path))
    assert "ends.b.up: has no length" in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["is empty", "Write keys"]),
        ("- a\n- b\n", ["not a group of keys"]),
        ("name: [1, 2\nwater: 3\n", ["case.yaml:2", "not valid YAML"]),
        ("name: a\n\twater: 3\n", ["case.yaml:2", "not valid YAML"]),
        ("name: !!python/object:os.system {}\n", ["case.yaml:1", "is not allowed"]),
        ("name: *unknown\n", ["case.yaml:1", "undefined alias"]),
        ("name: &a [*a]\n", ["nested too deeply"]),
        ("name: a\n---\nname: b\n", ["single document"]),
    ],
)
def test_text_that_is_no_case(text: str, words: list[str]) -> None:
    message = str(refusal(text))
    assert "case.yaml" in message
    for word in words:
        assert word in message


def test_file_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match=r"nowhere\.yaml: cannot be read: No such file"):
        load_case(tmp_path / "nowhere.yaml")
    with pytest.raises(CaseError, match="cannot be read"):
        load_case(tmp_path)
    (tmp_path / "latin.yaml").write_bytes(b"name: caf\xe9\n")
    with pytest.raises(CaseError, match="is not text in UTF-8"):
        load_case(tmp_path / "latin.yaml")


def test_case_made_in_python_is_refused_with_its_values() -> None:
    data = {"cable": {"length": -1.0}, "name": "x"}
    with pytest.raises(CaseError) as caught:
        Case.from_dict(data)
    problem = caught.value.problems[0]
    assert (problem.file, problem.line) == (None, None)
    assert "cable.length: must be greater than 0; received -1.0" in str(caught.value)


# Anything at all --------------------------------------------------------------------------------

ODD: list[Any] = [None, "", "x", "4 mm", True, -1, 0, 1e300, 1e-300, 10**400, math.nan, [], {}]
ODD += [[[[]]], [1, 2, 3], [[1, 2, 3], [4, 5, 6]], {"kind": 3}, {"motion": []}, {"shape": None}, {1: 2}, b"x"]


def places(part: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of everything in a case."""
    if path:
        yield path
    for key, value in (
        part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ()
    ):
        yield from places(value, (*path, key))


GOOD_DATA, _ = read_yaml(GOOD)


@pytest.mark.parametrize("group", [*GOOD_DATA, *PAYOUTS])
def test_whatever_stands_in_a_case_the_error_is_readable(group: str) -> None:
    good = GOOD_DATA if group in GOOD_DATA else read_yaml(with_winch(PAYOUTS[group]))[0]
    changed = group if group in GOOD_DATA else "winch"
    refused = 0
    for path in places({changed: good[changed]}):
        for odd in ODD:
            data = copy.deepcopy(good)
            part = data
            for key in path[:-1]:
                part = part[key]
            part[path[-1]] = odd
            try:
                build_scene(Case.from_dict(data))
            except CaseError as error:
                refused += 1
                for problem in error.problems:
                    assert problem.message
                    assert problem.remedy
                    assert "See the description" not in problem.remedy, str(problem)
    assert refused > 10


def test_a_case_with_everything_odd_is_refused() -> None:
    for odd in ODD:
        with pytest.raises(CaseError):
            Case.from_dict(odd)
