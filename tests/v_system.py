"""The V-system of cases/v_rest.yaml, and a short run of it."""

import functools
from pathlib import Path

import numpy as np

import cablesim

CASES = Path(__file__).parents[1] / "cases"
V_REST = cablesim.load_case(CASES / "v_rest.yaml")


@functools.cache
def v_run():
    """Eight seconds of the V in which the vehicle leaves, turning."""
    data = V_REST.model_dump(mode="json", exclude_none=True)
    data["ends"]["a"] = {
        "motion": "rov_waypoints",
        "position": [0, 0, -2],
        "heading": np.pi,
        "channels": ["surge", "yaw"],
        "waypoints": [[0, 0, 0], [1, 0.2, -0.2], [4, 0.2, -0.2], [5, 0, 0], [8, 0, 0]],
    }
    guess = [
        [0, 0, -2],
        [0.6, 0, -1.75],
        [1.05, 0, -1.9],
        [1.2, 0, -2.5],
        [1.35, 0, -1.9],
        [1.9, 0, -1.5],
        [2.6, 0, -2],
    ]
    data["initial"] = {"shape": "equilibrium", "through": guess}
    data["simulation"]["duration"] = 8.0
    data["output"]["interval"] = 0.05
    return cablesim.simulate(cablesim.Case.from_dict(data))


@functools.cache
def winch_run():
    """Six seconds of the paper's round trip, in which the winch pays out."""
    case = cablesim.load_case(CASES / "round_trip.yaml")
    data = case.model_dump(mode="json", exclude_none=True)
    data["simulation"]["duration"] = 6.0
    return cablesim.simulate(cablesim.Case.from_dict(data, directory=CASES))
