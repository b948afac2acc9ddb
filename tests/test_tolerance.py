"""What the default tolerances are worth: places and tension against runs of a tight tolerance."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from scenes import FREE, VACUUM, body, cable, held, scene

from cablesim import build_scene, load_case, motion, simulate
from cablesim.scene import End, Numerics, TautShape

CASES = Path(__file__).resolve().parents[1] / "cases"
KEPT = ("marker_position", "end_tension")
TIGHT = 1e-7

HEAVE, PERIOD, LOAD = 1.0, 10.0, 2000.0  # [m], [s], [kg]
WIRE = cable(length=1000.0, diameter=0.02, mass_per_length=1.6, axial_stiffness=2e7, density=VACUUM)


def heaved_load(rtol: float) -> xr.Dataset:
    """2 t on 1000 m of wire in vacuum, whose top heaves by a metre either way."""
    heave = motion.harmonic(np.zeros(3), np.array([0.0, 0.0, HEAVE]), PERIOD, duration=60.0, ramp=20.0)
    return simulate(
        scene(
            rope=WIRE,
            a=FREE,
            b=End(motion=heave),
            attachments=[body(0.0, mass=LOAD)],
            density=VACUUM,
            segments=100,
            duration=60.0,
            interval=0.05,
            variables=("end_tension",),
            relative_tolerance=rtol,
        )
    )


def tension_of_a_shaken_bar() -> float:
    """Its amplitude at the load: u'' = c2 u_ss, EA u_s = M u'' at the load, u = HEAVE at the top."""
    omega = 2.0 * np.pi / PERIOD
    k = omega * np.sqrt(WIRE.mass_per_length / WIRE.axial_stiffness)
    inertia = LOAD * omega**2
    lag = inertia / (WIRE.axial_stiffness * k) * np.sin(k * WIRE.length)
    return float(inertia * HEAVE / (np.cos(k * WIRE.length) - lag))


def amplitude(signal: NDArray[np.float64], times: NDArray[np.float64]) -> float:
    """Amplitude at the period of the heave."""
    phase = 2.0 * np.pi / PERIOD * times
    base = np.stack((np.ones_like(times), np.cos(phase), np.sin(phase)), axis=1)
    return float(np.hypot(*np.linalg.lstsq(base, signal, rcond=None)[0][1:]))


@pytest.mark.parametrize(("rtol", "bound"), [(Numerics().relative_tolerance, 0.01), (1e-3, 0.05)])
def test_dynamic_tension_of_a_heaved_load(rtol: float, bound: float) -> None:
    found = heaved_load(rtol).sel(time=slice(20.0, 60.0))
    strength = amplitude(found.end_tension.values[:, 0], found.time.values)
    wanted = tension_of_a_shaken_bar()
    print(f"rtol {rtol:g}: {strength:.2f} N of {wanted:.2f} N")
    assert strength == pytest.approx(wanted, rel=bound)


@cache
def of_gallery(name: str, rtol: float | None, refinement: int) -> xr.Dataset:
    """A case with markers; `rtol` None: as it stands."""
    case = build_scene(load_case(CASES / f"{name}.yaml"))
    numerics = case.numerics if rtol is None else replace(case.numerics, relative_tolerance=rtol)
    return simulate(
        replace(
            case,
            numerics=numerics,
            mesh=replace(case.mesh, segment_length=case.mesh.segment_length / refinement),
            output=replace(case.output, variables=KEPT, markers=np.linspace(0.0, case.cable.length, 21)),
        )
    )


def distance(one: xr.Dataset, other: xr.Dataset) -> float:
    """RMS distance of the markers that are out [m]."""
    squares = ((one.marker_position - other.marker_position) ** 2).sum("axis", skipna=False)
    return float(np.sqrt(squares.mean()))


@pytest.mark.parametrize("name", ["sway", "pendulum", "sheared_current", "tow", "winch_cycle", "turn"])
def test_the_mesh_decides_the_error_of_the_gallery(name: str) -> None:
    found, exact, finer = (of_gallery(name, *how) for how in ((None, 1), (TIGHT, 1), (TIGHT, 2)))
    of_mesh = 4.0 / 3.0 * distance(exact, finer)  # the error is of second order
    of_tolerance = distance(found, exact)
    tension = exact.end_tension.values
    spread = np.ptp(tension, axis=0)
    error = np.sqrt(((found.end_tension.values - tension) ** 2).mean(axis=0))
    held = spread > 0.02 * spread.max()  # a free end has no tension of its own
    share = float((error[held] / spread[held]).max())
    print(f"{name}: mesh {1e3 * of_mesh:.4f} mm, tolerance {1e3 * of_tolerance:.4f} mm, tension {share:.2e}")
    assert of_tolerance < of_mesh
    assert share < 0.01


def test_a_bob_keeps_its_amplitude() -> None:
    """19 swings in vacuum, where nothing but the integration takes energy out."""
    bob = scene(
        rope=cable(length=2.0, mass_per_length=0.005, density=VACUUM),
        a=held([0.0, 0.0, 0.0]),
        b=FREE,
        attachments=[body(2.0, mass=1.0)],
        density=VACUUM,
        initial=TautShape(direction=np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)),
        duration=56.0,
        interval=0.02,
        variables=("position",),
    )
    end = simulate(bob).position.values[:, -1]
    angle = np.arctan2(end[:, 0], -end[:, 2])
    last = np.abs(angle[-200:]).max()
    print(f"amplitude {np.degrees(last):.3f} deg of 45")
    assert last == pytest.approx(np.pi / 4.0, rel=0.01)
