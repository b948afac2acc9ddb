"""The elastic catenary (Irvine, Cable Structures).

Depends on: nothing of ours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, root

Array = NDArray[np.float64]


def elastic_catenary(span: Array, length: float, wet_weight: float, axial_stiffness: float) -> Array:
    """Force with which a hanging elastic cable is pulled at its lower-s end (Irvine, Cable Structures).

    Parameters
    ----------
    span : ndarray, shape (3,)
        From end A to end B [m].
    length : float
        Unstretched length [m].
    wet_weight : float
        Weight per unstretched metre [N/m], not nought; negative when the cable floats.
    axial_stiffness : float
        EA [N].

    Returns
    -------
    ndarray, shape (3,)
        The tension vector at end A, pointing into the cable; at s it is this plus (0, 0, wet_weight s) [N].
    """
    w = abs(wet_weight)
    up = np.sign(wet_weight)
    across, rise = float(np.hypot(span[0], span[1])), float(span[2]) * up
    heading = span[:2] / across if across > 0.0 else np.array([1.0, 0.0])
    across = max(across, 1e-9 * length)  # a cable folded on itself hangs from an all but vanishing pull

    def ends(horizontal: float, vertical: float) -> tuple[float, float]:
        top = vertical + w * length
        x = horizontal / w * (np.arcsinh(top / horizontal) - np.arcsinh(vertical / horizontal))
        z = (np.hypot(horizontal, top) - np.hypot(horizontal, vertical)) / w
        x += horizontal * length / axial_stiffness
        z += (vertical + 0.5 * w * length) * length / axial_stiffness
        return x, z

    def mismatch(unknown: Array) -> list[float]:
        x, z = ends(float(np.exp(unknown[0])), unknown[1] * w * length)
        return [(x - across) / length, (z - rise) / length]

    solution = root(mismatch, _catenary_start(across, rise, length, w, axial_stiffness), tol=1e-13)
    horizontal, vertical = float(np.exp(solution.x[0])), solution.x[1] * w * length
    return np.array([horizontal * heading[0], horizontal * heading[1], vertical * up])


def _catenary_start(
    across: float, rise: float, length: float, w: float, axial_stiffness: float
) -> list[float]:
    """Logarithm of the horizontal force, and vertical force at A over the weight, of a nearby cable."""
    chord = float(np.hypot(across, rise))
    if length > chord * (1.0 + 1e-6):
        # inextensible: sinh(u)/u = sqrt(L^2 - rise^2)/across
        ratio = np.sqrt(length**2 - rise**2) / across
        u = brentq(lambda u: np.log(np.sinh(u) / u) - np.log(ratio), 1e-9, 700.0)
        horizontal = w * across / (2.0 * u)
        vertical = 0.5 * w * (rise / np.tanh(u) - length)
    else:
        pull = max(axial_stiffness * (chord / length - 1.0), 0.1 * w * length)
        horizontal, vertical = pull * across / chord, pull * rise / chord - 0.5 * w * length
    return [float(np.log(horizontal)), float(vertical / (w * length))]
