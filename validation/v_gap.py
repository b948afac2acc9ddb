"""Distance between the buoys of the V-system at rest, against the elastica and the mesh.

The V alone (1.2 m of cable, a buoy at each free end, ballast in the middle) consists of two arms, each a
cantilever with the buoy's net lift at its tip: its span follows from elliptic integrals (Bisshopp and Drucker
1945). In the full scene the outer cable bends too, and its moment at the buoys opens the V.
"""

from __future__ import annotations

from common import CASES, Evidence, parser  # isort: skip - sets the threads

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipkinc

import cablesim
from cablesim.motion import fixed
from cablesim.scene import Attachment, End, EquilibriumShape, MeshRules, Scene

LIFT, ARM = 0.4, 0.6  # net lift of a buoy [N], length of an arm [m]: as in the case


def elastica_gap(bending_stiffness: float, lift: float, arm: float) -> float:
    """Exact distance between the buoys of the V alone [m]."""
    alpha = lift * arm**2 / bending_stiffness

    def mismatch(tip_angle: float) -> float:
        modulus = np.sqrt(0.5 * (1.0 + np.sin(tip_angle)))
        start = np.arcsin(np.sqrt(0.5) / modulus)
        return ellipkinc(np.pi / 2, modulus**2) - ellipkinc(start, modulus**2) - np.sqrt(alpha)

    tip_angle = brentq(mismatch, 1e-6, np.pi / 2 - 1e-9)
    return 2.0 * arm * np.sqrt(2.0 * np.sin(tip_angle) / alpha)


def v_alone(scene: Scene, segment_length: float) -> Scene:
    """The V of a scene without its outer cable, both ends free."""

    def body(name: str, position: float, lift: float) -> Attachment:
        volume = 1e-4
        mass = 1000.0 * volume - lift / scene.gravity
        return Attachment(
            name=name,
            kind="body",
            position=position,
            mass=mass,
            volume=volume,
            drag_area=1e-3,
            added_mass=0.5,
        )

    start = np.array([[-0.3, 0, 0], [-0.15, 0, -0.45], [0, 0, -0.55], [0.15, 0, -0.45], [0.3, 0, 0]])
    return replace(
        scene,
        cable=replace(scene.cable, length=2 * ARM),
        mesh=MeshRules(segment_length=segment_length),
        attachments=(body("a", 0.0, LIFT), body("ballast", ARM, -2 * LIFT), body("b", 2 * ARM, LIFT)),
        imus=(),
        end_a=End(motion=None),
        end_b=End(motion=None),
        initial=EquilibriumShape(guess=start),
    )


def full_scene(scene: Scene, segment_length: float, refined: float) -> Scene:
    """The whole case, started from equilibrium, on another mesh."""
    refinements = tuple(replace(r, segment_length=refined) for r in scene.mesh.refinements)
    return replace(
        scene,
        mesh=MeshRules(segment_length=segment_length, refinements=refinements),
        initial=EquilibriumShape(),
    )


def rest_gap(scene: Scene) -> tuple[float, str]:
    """Distance between first and last attachment at rest [m], and how the shape was found."""
    simulation = cablesim.Simulation(scene)
    place = simulation.observe().position[simulation.mesh.attachment_nodes]
    return float(np.linalg.norm(place[-1] - place[0])), simulation.initial.message


def with_outer_cable(scene: Scene, outer: float, span: float) -> Scene:
    """The case with `outer` metres of cable on both sides of the V and ends `span` metres apart."""
    shift = outer - scene.attachments[0].position
    moved = tuple(replace(a, position=a.position + shift) for a in scene.attachments)
    refinements = tuple(replace(r, position=r.position + shift) for r in scene.mesh.refinements)
    place_a = scene.end_a.motion.position(0.0)
    end_b = End(motion=fixed(place_a + np.array([span, 0.0, 0.0])))
    return replace(
        scene,
        cable=replace(scene.cable, length=2 * outer + 2 * ARM),
        mesh=replace(scene.mesh, refinements=refinements),
        attachments=moved,
        end_b=end_b,
        initial=EquilibriumShape(),
    )


def outer_cable_row(scene: Scene, outer: float) -> dict[str, Any]:
    """Distance of the buoys by how slack the outer cable is: its length over that of a straight one."""
    row: dict[str, Any] = {"outer cable, each side [m]": outer}
    for slack in (1.02, 1.1, 1.3, 2.0):
        try:
            row[f"slack {slack:g} [m]"], _ = rest_gap(
                with_outer_cable(scene, outer, (2 * outer + 0.22) / slack)
            )
        except cablesim.StaticsError:
            row[f"slack {slack:g} [m]"] = "no rest shape found"
    return row


def main() -> None:
    """Compare, and vary the mesh and the outer cable."""
    evidence = Evidence(__file__, __doc__, parser(__doc__).parse_args())
    scene = cablesim.build_scene(cablesim.load_case(CASES / "v_rest.yaml"))
    exact = elastica_gap(scene.cable.bending_stiffness, LIFT, ARM)
    for segment_length in (0.05, 0.025, 0.0125, 0.00625):
        gap, _ = rest_gap(v_alone(scene, segment_length))
        text = f"V alone, segments of {1e3 * segment_length:g} mm: distance of the buoys from the elastica's"
        evidence.claim(text, 100 * abs(gap / exact - 1), "%", at_most=0.005)
    rows = []
    for base, refined in ((0.05, 0.05), (0.05, 0.01), (0.025, 0.005), (0.0125, 0.0025)):
        gap, how = rest_gap(full_scene(scene, base, refined))
        rows.append(
            {"segments [mm]": 1e3 * base, "near the V": 1e3 * refined, "gap [m]": f"{gap:.4f}", "found": how}
        )
    evidence.table(rows, "the whole scene, 4 m of cable, by mesh")
    rows = [outer_cable_row(scene, outer) for outer in (0.5, 1.0, 2.0, 4.0)]
    evidence.table(
        rows, "the whole scene, by its outer cable", "The paper gives about 0.22 m; alone it is 0.220 m."
    )


if __name__ == "__main__":
    main()
