"""Everything the compiled equations read, packed into a few arrays.

Depends on: nothing of ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Entries of Parameters.cable and columns of Parameters.bodies, and entries of Parameters.constants.
MASS, ADDED_NORMAL, ADDED_TANGENTIAL, WET_WEIGHT, DRAG_NORMAL, DRAG_TANGENTIAL, DRAG_POINT, FLUID_MASS = (
    range(8)
)
EA_, EI_, TAU_, BETA_, KAPPA_, WINCH_START_ = range(6)

STILL, UNIFORM, PROFILE, GRIDDED = range(4)


@dataclass(frozen=True)
class Features:
    """What a scene needs; the equations are compiled for these and nothing else.

    Attributes
    ----------
    dimension : int
        3, or 2 when all motion stays in one vertical plane.
    bending, damping, point_drag : bool
        EI > 0; tau > 0; attachments with a drag area.
    current : int
        ``STILL``, ``UNIFORM``, ``PROFILE`` or ``GRIDDED``; the last two need positions.
    free_a, free_b : bool
        Ends without prescribed motion.
    clamp_a, clamp_b : bool
        Ends whose tangent is imposed.
    winch : bool
        The last segment gets longer or shorter.
    """

    dimension: int = 3
    bending: bool = False
    damping: bool = True
    point_drag: bool = False
    current: int = STILL
    free_a: bool = False
    free_b: bool = False
    clamp_a: bool = False
    clamp_b: bool = False
    winch: bool = False


class Parameters(NamedTuple):
    """Arrays read by the residual, all views of one buffer (see `pack`).

    Attributes
    ----------
    lengths : ndarray, shape (n,)
        Reference length of each segment [m]: its unstretched length, and for the segment of a winch that
        of the material segment of which it is the part that is out.
    cable : ndarray, shape (8,)
        What a metre of bare cable has, in the order of the names above: mass [kg/m], added mass normal
        and along [kg/m], wet weight [N/m], drag factors 1/2 rho Cn d and 1/2 rho Ct pi d [kg/m2], nought,
        and the mass on which the fluid's own acceleration acts [kg/m].
    bodies : ndarray, shape (n+1, 8)
        What is attached to each node, in the same order: [kg], [N], and 1/2 rho CdA [kg/m] for its drag.
    constants : ndarray, shape (6,)
        EA [N], EI [N m2], tau [s], beta [1/s], kappa [1/s], and the material coordinate at which the
        winch's segment begins [m].
    winch_breaks, winch_coefficients : ndarray
        Deployed length as a piecewise polynomial (m+1,), (m, 6, 1).
    breaks_a, coefficients_a, breaks_b, coefficients_b : ndarray
        Piecewise polynomials of the end positions, see `cablesim.motion.Motion`.
    clamps : ndarray, shape (2, D)
        Tangents imposed at A and at B.
    current_times, current_x, current_y, current_z : ndarray
        Grid of the current; length 1 where it is constant along an axis.
    current_velocity : ndarray, shape (t, x, y, z, D)
        Water velocity on that grid [m/s].
    """

    lengths: Array
    cable: Array
    bodies: Array
    constants: Array
    winch_breaks: Array
    winch_coefficients: Array
    breaks_a: Array
    coefficients_a: Array
    breaks_b: Array
    coefficients_b: Array
    clamps: Array
    current_times: Array
    current_x: Array
    current_y: Array
    current_z: Array
    current_velocity: Array


_RANKS = (1, 1, 2, 1, 1, 3, 1, 3, 1, 3, 2, 1, 1, 1, 1, 5)  # number of dimensions of each field


def pack(parameters: Parameters) -> tuple[Array, Parameters]:
    """Copy all arrays into one buffer behind a header of their shapes.

    Handing compiled code one array instead of sixteen takes 2 of 5 microseconds off every call of
    the residual.

    Parameters
    ----------
    parameters : Parameters
        Arrays of the ranks given in the class.

    Returns
    -------
    buffer : ndarray
        What the compiled equations take.
    views : Parameters
        The same arrays inside the buffer: writing to them changes the equations.
    """
    arrays = [np.asarray(array, dtype=float) for array in parameters]
    header = np.concatenate([array.shape for array in arrays]).astype(float)
    buffer = np.concatenate([header, *(array.ravel() for array in arrays)])
    return buffer, unpack(buffer)


def unpack(buffer: Array) -> Parameters:
    """Views of a buffer made by `pack`."""
    views = []
    start = sum(_RANKS)
    entry = 0
    for rank in _RANKS:
        shape = tuple(int(size) for size in buffer[entry : entry + rank])
        entry += rank
        size = int(np.prod(shape))
        views.append(buffer[start : start + size].reshape(shape))
        start += size
    return Parameters(*views)
