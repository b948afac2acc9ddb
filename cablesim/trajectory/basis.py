"""The paper's local frame.

Depends on: nothing of ours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def local_basis(tangent: Array) -> tuple[Array, Array]:
    """Unit vectors n and b of the paper's local frame (Fig. 2, psi = -pi/2) for tangents t.

    With t = (cos phi cos theta, -sin theta, -sin phi cos theta) (8): n = (-sin phi, 0, -cos phi) and
    b = t x n.  Along +-y, where phi is not defined, n points down.

    Parameters
    ----------
    tangent : ndarray, shape (..., 3)
        Unit tangents.

    Returns
    -------
    normal, binormal : ndarray, shape (..., 3)
        Unit vectors.
    """
    cos_theta = np.hypot(tangent[..., 0], tangent[..., 2])
    safe = np.where(cos_theta > 1e-12, cos_theta, 1.0)
    normal = np.zeros_like(tangent)
    normal[..., 0] = tangent[..., 2] / safe
    normal[..., 2] = np.where(cos_theta > 1e-12, -tangent[..., 0] / safe, -1.0)
    return normal, np.cross(tangent, normal)
