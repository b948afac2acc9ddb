"""Case files: units, lines, round trip, schema, and the numbers of the scene built from them."""

from __future__ import annotations

import json
import math
import pickle
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cablesim import scene as data
from cablesim.build import build_scene, default_interval
from cablesim.case import Case, CaseError, case_schema, load_case, models
from cablesim.case.quantities import _EVERYDAY, Quantity, UnitError, length_factor
from cablesim.control import BuoyGap, ConstantLength, ConstantTension, Measurement

ROOT = Path(__file__).resolve().parent.parent
GALLERY = sorted((ROOT / "cases").glob("*.yaml"))

MINIMAL: dict[str, Any] = {
    "name": "minimal",
    "cable": {"length": 3.0, "diameter": 0.005, "mass_per_length": 0.055, "axial_stiffness": 1e4},
    "mesh": {"segment_length": 0.05},
    "ends": {
        "a": {"motion": "fixed", "position": [0, 0, 0]},
        "b": {"motion": "fixed", "position": [1.5, 0, 0]},
    },
    "simulation": {"duration": 10.0},
}


def minimal(**changes: object) -> Case:
    return Case.from_dict({**MINIMAL, **changes})


def cable_of(**changes: object) -> Case:
    return minimal(cable={**MINIMAL["cable"], **changes})


# Units ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "text", "value"),
    [
        ("m", "4 mm", 4e-3),
        ("m", "4mm", 4e-3),
        ("m", " -1.5e1 cm ", -0.15),
        ("m", "12 ft", 3.6576),
        ("m", "3 µm", 3e-6),
        ("m", 4, 4.0),
        ("m**2", "6.4 mm^2", 6.4e-6),
        ("m**2", "6.4 mm2", 6.4e-6),
        ("m**2", "6.4 mm**2", 6.4e-6),
        ("m**2", "6.4 mm²", 6.4e-6),
        ("kg/m", "0.055 kg/m", 0.055),
        ("kg/m", "44.67 g/m", 0.04467),
        ("N", "1e4 N", 1e4),
        ("N", "1 kgf", 9.80665),
        ("N*m**2", "2.4e-3 N m^2", 2.4e-3),
        ("N*m**2", "2.4e-3 N·m²", 2.4e-3),
        ("s", "10 ms", 0.01),
        ("rad", "45 deg", math.pi / 4),
        ("rad", "45°", math.pi / 4),
        ("rad/s", "20 deg/s", math.radians(20)),
        ("m/s", "0.25 m/s", 0.25),
        ("m/s", "2 knot", 2 * 1852 / 3600),
        ("1/s", "10 1/s", 10.0),
        ("1/s", "10 Hz", 10.0),
        ("kg/m**3", "1025 kg/m^3", 1025.0),
        ("kg/m**3", "1.025 g/cm^3", 1025.0),
        ("N/m", "0.376 N/m", 0.376),
        ("m/s/N", "5 cm/s/N", 0.05),
        ("m/s/N", "5 mm s^-1 mN^-1", 5.0),
        ("m/s**2/N", "0.1 m/s^2/N", 0.1),
        ("m/s**2/N", "1 m/s^2/kN", 1e-3),
    ],
)
def test_text_with_a_unit_becomes_si(unit: str, text: str | float, value: float) -> None:
    assert Quantity("value", unit, "1").parse(text) == pytest.approx(value, rel=1e-12)


@pytest.fixture(scope="module")
def registry() -> Any:
    import pint

    return pint.UnitRegistry()


@pytest.mark.parametrize("target", _EVERYDAY)
def test_everyday_units_are_those_of_pint(target: str, registry: Any) -> None:
    for unit, factor in _EVERYDAY[target].items():
        spelled = re.sub(r"([ms])([23])", r"\1^\2", unit)
        assert registry.Quantity(1.0, spelled).to(target).magnitude == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize(
    "text", ["4 m m m/", "4 m**", "4 (m", "4 __import__('os')", "4 m;", "m", "4 4 m", "--4 m"]
)
def test_nonsense_is_refused(text: str) -> None:
    with pytest.raises(UnitError, match="Give a plain number in m or text such as"):
        Quantity("length", "m", "4 mm").parse(text)


def test_unit_of_a_recording() -> None:
    assert length_factor("mm") == 1e-3
    with pytest.raises(UnitError, match="no unit of length"):
        length_factor("kg")


def test_plain_numbers_do_not_load_pint() -> None:
    code = (
        "import sys; from cablesim.case import load_case; "
        f"load_case({str(ROOT / 'cases' / 'sway.yaml')!r}); assert 'pint' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# Reading and writing ----------------------------------------------------------------------------


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_gallery_case_loads_and_builds(path: Path) -> None:
    case = load_case(path)
    assert path.read_text().startswith("# ")
    assert case.name == path.stem
    assert case.directory == path.parent
    scene = build_scene(case)
    assert scene.name == path.stem
    assert Case.from_yaml(scene.source) == case


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_round_trip(path: Path) -> None:
    case = load_case(path)
    again = Case.from_yaml(case.to_yaml())
    assert again == case
    assert hash(again) == hash(case)
    assert again.to_yaml() == case.to_yaml()
    assert Case.from_dict(case.model_dump()) == case
    assert pickle.loads(pickle.dumps(case)) == case


def test_cases_that_differ_are_not_equal() -> None:
    assert minimal() == minimal()
    assert minimal() != minimal(gravity=9.8)
    assert minimal() != MINIMAL


def test_case_made_in_python() -> None:
    made = Case(
        name="minimal",
        cable=models.Cable(length=3.0, diameter=0.005, mass_per_length=0.055, axial_stiffness=1e4),
        mesh=models.Mesh(segment_length=0.05),
        ends=models.Ends(
            a=models.FixedEnd(motion="fixed", position=(0, 0, 0)),
            b=models.FixedEnd(motion="fixed", position=(1.5, 0, 0)),
        ),
        simulation=models.Simulation(duration=10.0),
    )
    assert made == minimal()
    assert made.directory == Path.cwd()


def test_case_made_in_python_is_refused_with_its_values() -> None:
    made = minimal().model_copy(update={"output": models.Output(interval=20.0)})
    made = Case.model_validate(made.model_dump())
    with pytest.raises(CaseError, match=r"output\.interval: is longer than the run of 10 s; received 20\.0"):
        build_scene(made)


def test_a_case_is_frozen() -> None:
    with pytest.raises(ValueError, match="frozen"):
        minimal().name = "other"


def test_anchors_and_merge_keys() -> None:
    text = """\
name: anchors
cable: {length: 3, diameter: 5 mm, mass_per_length: 55 g/m, axial_stiffness: 1e4}
mesh: {segment_length: 5 cm}
attachments:
  - &buoy {kind: buoy, name: one, at: 1, mass: 20 g, volume: 60 cm^3}
  - {<<: *buoy, name: two, at: 2}
ends: {a: {motion: fixed, position: &here [0, 0, 0]}, b: {motion: fixed, position: *here}}
simulation: {duration: 1}
"""
    case = Case.from_yaml(text)
    assert [attachment.name for attachment in case.attachments] == ["one", "two"]
    assert [getattr(attachment, "mass", None) for attachment in case.attachments] == [0.02, 0.02]
    with pytest.raises(
        CaseError, match=r"line 6: attachments\[1\]\.at: must not be less than 0; received -2"
    ):
        Case.from_yaml(text.replace("at: 2", "at: -2"))


def test_yaml_is_version_1_2() -> None:
    case = Case.from_yaml(json.dumps({**MINIMAL, "name": "no", "description": "on"}))  # JSON is YAML
    assert (case.name, case.description) == ("no", "on")
    text = minimal().to_yaml().replace("10000.0", "1e4")
    assert Case.from_yaml(text) == minimal()


def test_errors_survive_pickling() -> None:
    with pytest.raises(CaseError) as caught:
        minimal(gravity=-1)
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value)
    assert again.problems == caught.value.problems


# Schema -----------------------------------------------------------------------------------------


def described(schema: object) -> list[tuple[str, Any]]:
    """All named properties in a schema."""
    if isinstance(schema, list):
        return [found for part in schema for found in described(part)]
    if not isinstance(schema, dict):
        return []
    properties = schema.get("properties", {})
    here = list(properties.items()) if isinstance(properties, dict) else []
    return here + [found for part in schema.values() for found in described(part)]


def test_schema_describes_every_key() -> None:
    schema = case_schema()
    json.dumps(schema)
    assert schema["$schema"].endswith("2020-12/schema")
    assert set(schema["properties"]) == set(Case.model_fields)
    assert schema["additionalProperties"] is False
    for name, field in described(schema):
        assert "description" in field, f"{name} has no description"


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_gallery_fits_the_schema(path: Path) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    from cablesim.case.read import read_yaml

    validator = jsonschema.Draft202012Validator(case_schema())
    validator.check_schema(case_schema())
    for text in (path.read_text(), load_case(path).to_yaml()):
        written, _ = read_yaml(text)
        assert [error.message for error in validator.iter_errors(written)] == []
        written["cable"]["diametr"] = 3
        assert list(validator.iter_errors(written))


# Numbers of the scene ---------------------------------------------------------------------------


def test_weight_from_the_diameter() -> None:
    cable = build_scene(minimal()).cable
    assert cable.displaced_section == pytest.approx(math.pi * 0.005**2 / 4)
    assert cable.wet_weight == pytest.approx((0.055 - 1000 * math.pi * 0.005**2 / 4) * 9.81)


def test_section_from_a_measured_weight() -> None:
    """Cable 6: a porous rope, displaced section 6.4e-6 m2 and not the 9.6e-6 m2 of its circle."""
    case = cable_of(diameter=0.0035, mass_per_length=0.04467, wet_weight=0.376)
    cable = build_scene(case).cable
    assert cable.wet_weight == 0.376
    assert cable.displaced_section == pytest.approx(6.342e-6, rel=1e-3)


def test_neutral_cable_displaces_its_mass() -> None:
    cable = build_scene(cable_of(diameter="4 mm", mass_per_length="12.57 g/m", wet_weight=0)).cable
    assert cable.wet_weight == 0
    assert cable.displaced_section == pytest.approx(1.257e-5)


def test_added_mass_goes_with_the_outer_section() -> None:
    """Cable 6 displaces two thirds of its circle; the water around it has all of the circle to go around."""
    porous = {"diameter": 0.0035, "mass_per_length": 0.04467, "wet_weight": 0.376}
    circle = math.pi * 0.0035**2 / 4
    assert build_scene(cable_of(**porous)).cable.added_mass_section == pytest.approx(circle)
    composite = cable_of(diameter=0.0035, displaced_section="5 mm^2")
    assert build_scene(composite).cable.added_mass_section == pytest.approx(circle)
    given = build_scene(cable_of(**porous, added_mass_section="8 mm^2")).cable
    assert given.added_mass_section == pytest.approx(8e-6)
    assert given.wet_weight == 0.376


def test_floating_cable() -> None:
    assert build_scene(cable_of(wet_weight=-0.1)).cable.displaced_section > 0.055 / 1000


def test_weight_from_a_given_section() -> None:
    cable = build_scene(cable_of(displaced_section="1e-5 m^2")).cable
    assert cable.wet_weight == pytest.approx((0.055 - 0.01) * 9.81)


def test_vacuum() -> None:
    scene = build_scene(minimal(water={"density": 0}))
    assert scene.cable.wet_weight == pytest.approx(0.055 * 9.81)
    assert isinstance(scene.water.current, data.StillWater)


def test_no_gravity() -> None:
    cable = build_scene(minimal(gravity=0)).cable
    assert cable.wet_weight == 0
    assert cable.displaced_section == pytest.approx(math.pi * 0.005**2 / 4)


def test_implausible_diameter_is_remarked() -> None:
    assert "did you mean 5 mm" in build_scene(cable_of(diameter=5, wet_weight=0.3)).warnings[0]


def test_bodies_and_sensors() -> None:
    scene = build_scene(
        minimal(
            attachments=[
                {"kind": "buoy", "name": "float", "at": 1, "mass": "20 g", "volume": "60 cm^3"},
                {"kind": "imu", "name": "one", "at": 1},
                {"kind": "imu", "name": "two", "at": 2, "mounting": {"rotation_vector": [0, 0, "90 deg"]}},
            ],
            mesh={
                "segment_length": 0.05,
                "refine": [
                    {"around": "float", "within": 0.1, "segment_length": 0.01},
                    {"at": 2.5, "within": 0.1, "segment_length": 0.02},
                ],
            },
        )
    )
    assert scene.attachments == (
        data.Attachment(
            name="float", kind="buoy", position=1, mass=0.02, volume=6e-5, drag_area=0, added_mass=0.5
        ),
    )
    assert [imu.name for imu in scene.imus] == ["one", "two"]
    np.testing.assert_allclose(scene.imus[0].mounting, [0, 0, 0, 1])
    np.testing.assert_allclose(scene.imus[1].mounting, [0, 0, math.sqrt(0.5), math.sqrt(0.5)])
    assert [(rule.position, rule.segment_length) for rule in scene.mesh.refinements] == [
        (1, 0.01),
        (2.5, 0.02),
    ]


def with_end_b(**end: Any) -> Case:
    ends = {"a": {"motion": "fixed", "position": [0, 0, 0]}, "b": end}
    return minimal(ends=ends)


def motion_of(**end: Any) -> data.Motion:
    motion = build_scene(with_end_b(**end)).end_b.motion
    assert motion is not None
    return motion


def test_velocity_waypoints() -> None:
    rows = [[0, 0, 0, 0], ["500 ms", 0, "0.5 m/s", 0], [4, 0, 0.5, 0], [4.5, 0, 0, 0]]
    motion = motion_of(motion="velocity_waypoints", position=[1.5, 0, 0], waypoints=rows)
    np.testing.assert_allclose(motion.velocity(2.0), [0, 0.5, 0])
    np.testing.assert_allclose(motion.position(10.0), [1.5, 2.0, 0])


def test_rov_waypoints_of_table_iv() -> None:
    """The Turn of Table IV: columns t, surge, yaw."""
    rows = [
        [0, 0, 0],
        [1, 0.2, 0],
        [2, 0.2, 0],
        [3, 0.2, -0.4],
        [6, 0.2, -0.4],
        [7, 0.2, 0],
        [8, 0.2, 0],
        [10, 0, 0],
    ]
    motion = motion_of(
        motion="rov_waypoints",
        position=[1, 0, 0],
        channels=["surge", "yaw"],
        waypoints=rows,
        heading="90 deg",
    )
    np.testing.assert_allclose(motion.velocity(1.5), [0, 0.2, 0], atol=1e-12)
    turned = math.pi / 2 - 0.4 * (0.5 + 3 + 0.5)
    np.testing.assert_allclose(
        motion.velocity(7.5), [0.2 * math.cos(turned), 0.2 * math.sin(turned), 0], atol=1e-9
    )


def test_rov_waypoints_with_all_channels() -> None:
    rows = [[0, 0.1, 0.2, "30 cm/s", 0]]
    motion = motion_of(motion="rov_waypoints", position=[0, 0, 0], waypoints=rows)
    np.testing.assert_allclose(motion.velocity(1.0), [0.1, 0.2, 0.3])


def test_harmonic_end() -> None:
    motion = motion_of(
        motion="harmonic", position=[1, 0, 0], amplitude=[0, 0, "50 cm"], period="8 s", phase="90 deg"
    )
    np.testing.assert_allclose(motion.position(0.0), [1, 0, 0.5], atol=1e-9)
    np.testing.assert_allclose(motion.position(4.0), [1, 0, -0.5], atol=1e-8)


def test_recorded_end_is_scaled_moved_and_turned(tmp_path: Path) -> None:
    """A recording in millimetres with x upwards; the mean of the rows of the rod becomes the origin."""
    times = np.linspace(0.0, 12.0, 121)
    rows = [f"{t},robot,{2000 + 500},{1000 + 100 * t},0" for t in times]
    rod = [f"{t},rod,{2000 + 10 * (-1) ** k},1000,0" for k, t in enumerate(times[:-1])]
    (tmp_path / "end.csv").write_text("\n".join(["t,point,a,b,c", *rows, *rod]))
    case = with_end_b(
        motion="recorded",
        file="end.csv",
        time_column="t",
        columns=["a", "b", "c"],
        where={"point": "robot"},
        unit="mm",
        up=[1, 0, 0],
        origin={"where": {"point": "rod"}},
        start="1 s",
    )
    motion = build_scene(case, directory=tmp_path).end_b.motion
    assert motion is not None
    np.testing.assert_allclose(motion.position(0.0), [0, 0.1, 0.5], atol=1e-6)
    np.testing.assert_allclose(motion.velocity(5.0), [0, 0.1, 0], atol=1e-6)
    assert motion.end_time == pytest.approx(11.0)


def test_clamp_is_a_unit_vector() -> None:
    ends = {
        "a": {"motion": "fixed", "position": [0, 0, 0], "clamp": [0, 0, -2]},
        "b": {"motion": "free"},
    }
    scene = build_scene(minimal(ends=ends, cable={**MINIMAL["cable"], "bending_stiffness": 1e-3}))
    assert scene.end_a.clamp is not None
    np.testing.assert_allclose(scene.end_a.clamp, [0, 0, -1])
    assert scene.end_b.motion is None


def test_shapes() -> None:
    assert build_scene(minimal()).initial == data.EquilibriumShape()
    assert build_scene(minimal(initial={"shape": "catenary"})).initial == data.CatenaryShape()
    guess = build_scene(
        minimal(initial={"shape": "equilibrium", "through": [[0, 0, 0], [1.5, 0, 0]]})
    ).initial
    assert isinstance(guess, data.EquilibriumShape)
    assert guess.guess is not None
    assert guess.guess.shape == (2, 3)
    free = {"a": {"motion": "fixed", "position": [0, 0, 0]}, "b": {"motion": "free"}}
    taut = build_scene(minimal(ends=free, initial={"shape": "taut", "direction": [1, 0, -1]})).initial
    assert isinstance(taut, data.TautShape)
    assert taut.direction is not None
    np.testing.assert_allclose(taut.direction, np.array([1, 0, -1]) / math.sqrt(2))


@pytest.mark.parametrize("place", ["a", "b"])
def test_two_free_ends_start_where_one_says(place: str) -> None:
    ends: dict[str, dict[str, Any]] = {"a": {"motion": "free"}, "b": {"motion": "free"}}
    ends[place]["position"] = [1, 2, 3]
    shape = build_scene(minimal(ends=ends, initial={"shape": "taut", "direction": [0, 0, 2]})).initial
    assert isinstance(shape, data.TautShape)
    assert shape.places is not None
    np.testing.assert_allclose(np.diff(shape.places, axis=0), [[0, 0, 3]])
    np.testing.assert_allclose(shape.places[0 if place == "a" else -1], [1, 2, 3])


def test_markers_are_tied_to_the_ends() -> None:
    markers: dict[str, Any] = {
        "arc": [0.001, 1.5, 3.002],
        "positions": [[0, 0.01, 0], [0.75, 0, -1.2], [1.49, 0, 0]],
    }
    shape = build_scene(minimal(initial={"shape": "markers", **markers})).initial
    assert isinstance(shape, data.MarkerShape)
    np.testing.assert_allclose(shape.positions, [[0, 0, 0], [0.75, 0, -1.2], [1.5, 0, 0]])
    np.testing.assert_allclose(shape.arc, [0, 1.5, 3])


@pytest.mark.parametrize(
    ("duration", "interval"),
    [
        (10, 0.02),
        (6, 0.01),
        (9.27, 0.01),
        (60, 0.1),
        (500, 1),
        (3600, 5),
        (0.1, 1e-3),
        (1e-4, 1e-4),
        (1, 2e-3),
    ],
)
def test_default_interval_is_round(duration: float, interval: float) -> None:
    assert default_interval(duration) == interval


def test_output() -> None:
    output = build_scene(minimal(output={"markers": {"count": 4}, "variables": ["tension"]})).output
    np.testing.assert_allclose(output.markers, [0, 1, 2, 3])
    assert output.variables == ("tension",)
    assert output.interval == 0.02
    spaced = build_scene(minimal(output={"markers": {"spacing": "30 cm"}})).output.markers
    np.testing.assert_allclose(spaced, np.arange(11) * 0.3)
    assert spaced[-1] <= 3.0
    listed = build_scene(minimal(output={"markers": [0.5, "2 m"]})).output.markers
    np.testing.assert_allclose(listed, [0.5, 2.0])
    assert build_scene(minimal()).output.markers.size == 0


def test_numerics_are_passed_on() -> None:
    numbers = {"relative_tolerance": 1e-5, "max_order": 3, "max_step": "1 s", "max_steps": 7}
    others = {"linear_solver": "band", "strain_feedback": 5, "closure_feedback": 6, "skip": False}
    scene = build_scene(minimal(simulation={"duration": 2, **numbers, **others}))
    assert scene.numerics == data.Numerics(
        relative_tolerance=1e-5,
        max_order=3,
        max_step=1.0,
        max_steps=7,
        linear_solver="band",
        strain_feedback=5.0,
        closure_feedback=6.0,
        skip=False,
    )
    assert build_scene(minimal()).numerics == data.Numerics()


# Winch ------------------------------------------------------------------------------------------

BUOYS = [
    {"kind": "buoy", "name": "port", "at": 1, "mass": 0.02, "volume": 6e-5},
    {"kind": "buoy", "name": "starboard", "at": 1.5, "mass": 0.02, "volume": 6e-5},
]


def winch_of(payout: dict[str, Any], directory: Path | None = None, **winch: Any) -> data.Winch:
    """Winch of the minimal case with 8 m of cable, 3 m of it deployed."""
    parts: dict[str, Any] = {
        "cable": {**MINIMAL["cable"], "length": 8.0},
        "attachments": BUOYS,
        "winch": {"deployed_length": "3 m", "payout": payout, **winch},
    }
    found = build_scene(minimal(**parts), directory=directory).winch
    assert found is not None
    return found


def controller_of(payout: dict[str, Any], directory: Path | None = None, **winch: Any) -> Any:
    program = winch_of(payout, directory, **winch).payout
    assert isinstance(program, data.Control)
    return program.make()


def test_no_winch_is_the_default() -> None:
    scene = build_scene(minimal())
    assert scene.winch is None
    assert scene.start_length == 3.0


def test_winch_with_waypoints() -> None:
    rows = [["-1 s", 0], ["0 s", "10 cm/s"], [2, 0.3], [4, "-0.1 m/s"]]
    winch = winch_of({"kind": "waypoints", "waypoints": rows})
    assert winch.deployed_length == 3.0
    assert (winch.maximum_speed, winch.maximum_acceleration) == (math.inf, math.inf)
    assert winch.minimum_length == 0.0
    assert isinstance(winch.payout, data.Motion)
    assert winch.payout.coefficients.shape[2] == 1
    np.testing.assert_allclose(winch.payout.position([0.0, 2.0, 4.0, 5.0])[:, 0], [3.0, 3.4, 3.6, 3.5])
    np.testing.assert_allclose(winch.payout.velocity([1.0, 9.0])[:, 0], [0.2, -0.1])


def test_limits_of_a_winch() -> None:
    rows = [[0, 0], [0.5, 0.25]]
    limits = {"maximum_speed": "25 cm/s", "maximum_acceleration": 0.5, "minimum_length": "50 cm"}
    winch = winch_of({"kind": "waypoints", "waypoints": rows}, **limits)  # just what it can do
    assert (winch.maximum_speed, winch.maximum_acceleration) == (0.25, 0.5)
    assert winch.minimum_length == 0.5


@pytest.mark.parametrize("rows", [[[0, 0], [10, 0.1], [11, 9]], [[-1, 9], [-1, 0], [0, 0]]])
def test_limits_hold_during_the_run(rows: list[list[float]]) -> None:
    payout = {"kind": "waypoints", "waypoints": rows}
    assert winch_of(payout, maximum_speed=0.2, maximum_acceleration=0.5).maximum_speed == 0.2


def test_recorded_payout_begins_at_the_deployed_length(tmp_path: Path) -> None:
    """An encoder in millimetres that is 4 mm off at its start: the case says what is deployed."""
    times = np.linspace(0.0, 12.0, 121)
    rows = [f"{t:.2f};{3004 + 200 * (t - 1):.3f}" for t in times]
    (tmp_path / "encoder.csv").write_text("\n".join(["t;out", *rows]))
    payout = {"kind": "recorded", "file": "encoder.csv", "column": "out", "time_column": "t"}
    winch = winch_of({**payout, "unit": "mm", "start": "1 s"}, tmp_path)
    assert isinstance(winch.payout, data.Motion)
    np.testing.assert_allclose(winch.payout.position([0.0, 5.0])[:, 0], [3.0, 4.0], atol=1e-9)
    assert winch.payout.end_time == pytest.approx(11.0)


def test_payout_of_an_earlier_result(tmp_path: Path) -> None:
    netCDF4 = pytest.importorskip("netCDF4")
    times = np.linspace(0.0, 10.0, 201)
    with netCDF4.Dataset(tmp_path / "earlier.nc", "w") as file:
        file.createDimension("time", times.size)
        for name, values in (("time", times), ("deployed_length", 3.0 + 0.1 * times - 0.01 * np.sin(times))):
            file.createVariable(name, "f8", ("time",))[:] = values
    winch = winch_of({"kind": "recorded", "file": "earlier.nc", "noise": 0}, tmp_path)
    assert isinstance(winch.payout, data.Motion)
    assert winch.payout.velocity(4.0)[0] == pytest.approx(0.1 - 0.01 * math.cos(4.0), abs=1e-6)


def test_buoy_gap() -> None:
    payout = {"kind": "buoy_gap", "buoys": ["port", "starboard"], "gap": "25 cm", "proportional": "2 1/s"}
    winch = winch_of({**payout, "delay": "100 ms", "derivative": 0.5})
    assert isinstance(winch.payout, data.Control)
    assert (winch.payout.period, winch.payout.delay) == (0.05, 0.1)
    controller = winch.payout.make()
    assert isinstance(controller, BuoyGap)
    assert controller is not winch.payout.make()
    places = {"port": np.array([0, 0, 0.3]), "starboard": np.array([0.4, 0, 0])}
    seen = Measurement(
        time=0.0,
        deployed_length=3.0,
        payout_speed=0.0,
        tension_a=1.0,
        tension_b=2.0,
        locate=lambda name: (places[name], np.zeros(3)),
    )
    assert controller(seen) == pytest.approx(2.0 * (0.5 - 0.25))
    assert pickle.loads(pickle.dumps(winch)).payout.make()(seen) == controller(seen)


def test_buoy_gap_with_a_table(tmp_path: Path) -> None:
    (tmp_path / "gap.csv").write_text("speed,gap\n0,0.2\n0.5,0.3\n")
    payout = {"kind": "buoy_gap", "buoys": ["port", "starboard"], "table": "gap.csv", "proportional": 1}
    controller = controller_of({**payout, "speed_time": "2 s"}, tmp_path)
    np.testing.assert_array_equal(controller.speeds, [0, 0.5])
    np.testing.assert_array_equal(controller.gaps, [0.2, 0.3])
    assert controller.speed_time == 2.0


def test_constant_tension_is_limited_as_the_winch_is() -> None:
    payout = {"kind": "constant_tension", "tension": "2 N", "proportional": "5 cm/s/N", "integral": 0.1}
    made = controller_of(payout, maximum_speed=0.4)
    assert isinstance(made, ConstantTension)
    assert (made.tension, made.proportional, made.integral, made.end) == (2.0, 0.05, 0.1, "b")
    assert made.speed_limit == 0.4
    assert controller_of({**payout, "speed_limit": 0.3, "end": "a"}, maximum_speed=0.4).speed_limit == 0.3
    assert controller_of(payout).speed_limit == math.inf


def test_constant_length() -> None:
    made = controller_of({"kind": "constant_length", "length": "350 cm", "proportional": 0.5})
    assert isinstance(made, ConstantLength)
    assert (made.length, made.proportional) == (3.5, 0.5)


def test_function_beside_the_case(tmp_path: Path) -> None:
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws" / "mine.py").write_text("def slack(measured, target):\n    return target\n")
    payout = {"kind": "function", "function": "laws/mine.py:slack", "options": {"target": 0.25, "rest": None}}
    with pytest.raises(CaseError, match=r"would be given \(the measurement, target, rest\)"):
        controller_of(payout, tmp_path)
    assert controller_of({**payout, "options": {"target": 0.25}}, tmp_path)(None) == 0.25


@pytest.mark.parametrize(
    "payout",
    [
        {"kind": "waypoints", "waypoints": [["0 s", "0 m/s"], [2, 0.3]]},
        {"kind": "recorded", "file": "out.csv", "time_column": "t", "where": {"run": 3}},
        {"kind": "buoy_gap", "buoys": ["port", "starboard"], "gap": 0.25, "proportional": "2 1/s"},
        {"kind": "constant_tension", "tension": "2 N", "proportional": "5 cm/s/N"},
        {"kind": "constant_length", "length": 3, "proportional": 1},
        {"kind": "function", "function": "a.py:b", "options": {"gain": [1, None, {"x": "y"}], "none": None}},
    ],
    ids=lambda payout: payout["kind"],
)
def test_winches_survive_writing_and_fit_the_schema(payout: dict[str, Any]) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    written = {**MINIMAL, "winch": {"deployed_length": "3 m", "maximum_speed": "1 m/s", "payout": payout}}
    case = Case.from_dict(written)
    assert Case.from_yaml(case.to_yaml()) == case
    assert pickle.loads(pickle.dumps(case)) == case
    validator = jsonschema.Draft202012Validator(case_schema())
    assert [error.message for error in validator.iter_errors(json.loads(json.dumps(written)))] == []
    written["winch"]["payout"] = {**payout, "knid": 1}
    assert list(validator.iter_errors(json.loads(json.dumps(written))))


def test_shapes_at_the_start_are_those_of_the_deployed_cable() -> None:
    parts: dict[str, Any] = {
        "cable": {**MINIMAL["cable"], "length": 8.0},
        "winch": {"deployed_length": 1.5, "payout": {"kind": "waypoints", "waypoints": [[0, 0.1]]}},
        "output": {"markers": [0.5, 7.5]},  # the second is still on the drum
    }
    assert build_scene(minimal(**parts, initial={"shape": "taut"})).initial == data.TautShape()
    markers = {"shape": "markers", "arc": [0, 1.501], "positions": [[0, 0, 0], [1.5, 0, 0]]}
    scene = build_scene(minimal(**parts, initial=markers))
    assert isinstance(scene.initial, data.MarkerShape)
    np.testing.assert_allclose(scene.initial.arc, [0, 1.5])
    np.testing.assert_allclose(scene.output.markers, [0.5, 7.5])
    assert (scene.start_length, scene.cable.length) == (1.5, 8.0)


# Currents ---------------------------------------------------------------------------------------


def test_currents() -> None:
    uniform = build_scene(minimal(water={"current": {"kind": "uniform", "velocity": ["1 knot", 0, 0]}}))
    assert isinstance(uniform.water.current, data.UniformCurrent)
    np.testing.assert_allclose(uniform.water.current.velocity, [1852 / 3600, 0, 0])
    profile = {"kind": "profile", "heights": [-10, 0], "velocities": [[0, 0, 0], [1, 0, 0]]}
    current = build_scene(minimal(water={"current": profile})).water.current
    assert isinstance(current, data.ProfileCurrent)
    assert current.velocities.shape == (2, 3)


def write_map(path: Path, *, gap: bool = False, unit: str = "m") -> None:
    """A map against time in hours and depth, u = 1 + t/h, v = depth."""
    netCDF4 = pytest.importorskip("netCDF4")
    with netCDF4.Dataset(path, "w") as file:
        for name, values, attributes in (
            ("time", [0.0, 1.0, 2.0], {"units": "hours since 2024-01-01"}),
            ("depth", [0.0, 5.0], {"units": unit, "positive": "down"}),
        ):
            file.createDimension(name, len(values))
            variable = file.createVariable(name, "f8", (name,))
            variable[:] = values
            variable.setncatts(attributes)
        u = file.createVariable("east", "f8", ("depth", "time"))
        u[:] = np.ma.masked_equal([[1, 2, 3], [1, 2, -1 if gap else 3]], -1)
        file.createVariable("north", "f8", ("depth",))[:] = [0, 5]


MAP = {"kind": "map", "file": "map.nc", "u": "east", "v": "north", "z": "depth"}


def test_current_on_a_map(tmp_path: Path) -> None:
    write_map(tmp_path / "map.nc")
    current = build_scene(minimal(water={"current": MAP}), directory=tmp_path).water.current
    assert isinstance(current, data.GriddedCurrent)
    np.testing.assert_allclose(current.times, [0, 3600, 7200])
    np.testing.assert_allclose(current.z, [-5, 0])
    assert current.velocities.shape == (3, 1, 1, 2, 3)
    np.testing.assert_allclose(current.velocities[:, 0, 0, 1, 0], [1, 2, 3])
    np.testing.assert_allclose(current.velocities[0, 0, 0, :, 1], [5, 0])
    assert not current.velocities[..., 2].any()


@pytest.mark.parametrize(
    ("changes", "options", "words"),
    [
        ({"u": "est"}, {}, "has no variable 'est'; received 'map.nc'. Did you mean 'east'?"),
        ({}, {"gap": True}, "'east' is not finite everywhere"),
        ({"z": "z"}, {}, "'east' has the unknown dimension 'depth'"),
        ({}, {"unit": "degrees_east"}, "'depth' is in 'degrees_east', not in a length"),
    ],
)
def test_map_that_does_not_fit(
    tmp_path: Path, changes: dict[str, str], options: dict[str, Any], words: str
) -> None:
    write_map(tmp_path / "map.nc", **options)
    with pytest.raises(CaseError) as caught:
        build_scene(minimal(water={"current": {**MAP, **changes}}), directory=tmp_path)
    assert words in str(caught.value)


# Recordings -------------------------------------------------------------------------------------


def test_cable_6_run_0024() -> None:
    """The recorded robot end and the last marker of frame 3 are the same point, measured twice."""
    scene = build_scene(load_case(ROOT / "cases" / "cable6_run0024.yaml"))
    assert isinstance(scene.initial, data.MarkerShape)
    assert scene.initial.arc.size == 16
    assert scene.output.markers.size == 14
    assert scene.end_b.motion is not None
    chords = np.linalg.norm(np.diff(scene.initial.positions, axis=0), axis=1)
    np.testing.assert_allclose(chords, np.diff(scene.initial.arc), atol=8e-3)
    # started 1.41 m from the rod, 0.57 m below it; commanded 0.6 m/s, reached 0.55 to 0.73
    start = scene.initial.positions[-1]
    np.testing.assert_allclose(scene.end_b.motion.position(0.0), start)
    assert np.hypot(*start[:2]) == pytest.approx(1.41, abs=0.01)
    assert start[2] == pytest.approx(-0.57, abs=0.01)
    assert 0.5 < scene.end_b.motion.speed_limit(scene.duration) < 0.75
