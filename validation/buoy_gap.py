"""Distance between the buoys of the V against their speed: the set point of the winch's controller.

The scene of the paper's Section V is towed steadily, both ends at the same speed in the direction in which
the vehicle starts, with the cable that is out at the start: drag opens the V.  Each state is a rest shape in
the moving frame.  The table is stored beside the case that names it.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import cablesim
from cablesim.motion import velocity_waypoints
from cablesim.scene import End, Scene

CASE = Path(__file__).parent.parent / "cases" / "round_trip.yaml"
SPEEDS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4)  # [m/s]


def towed(scene: Scene, speed: float) -> Scene:
    """The scene with the cable that is out at its start, both ends towed at `speed` [m/s]."""

    def pulled(end: End) -> End:
        place = end.motion.position(0.0)
        return replace(end, motion=velocity_waypoints(place, [0.0], [[-speed, 0.0, 0.0]]))

    return replace(
        scene,
        cable=replace(scene.cable, length=scene.start_length),
        end_a=pulled(scene.end_a),
        end_b=pulled(scene.end_b),
        winch=None,
    )


def gap(scene: Scene) -> float:
    """Distance between the two buoys [m]."""
    simulation = cablesim.Simulation(scene)
    first, last = (simulation.mesh.attachment_nodes[k] for k in (0, -1))
    places = simulation.observe().position
    return float(np.linalg.norm(places[last] - places[first]))


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=CASE.parent / "buoy_gap.csv")
    scene = cablesim.build_scene(cablesim.load_case(CASE))
    rows = [(speed, gap(towed(scene, speed))) for speed in SPEEDS]
    text = "\n".join(["speed,gap", *(f"{speed:g},{distance:.4f}" for speed, distance in rows)]) + "\n"
    parser.parse_args().output.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
