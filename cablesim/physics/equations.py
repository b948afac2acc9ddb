"""Residual F(t, Y, Y') of the discrete cable and its analytic Jacobian, compiled by need.

Depends on: physics.parameters (names of columns).

Each equation is written once: first its residual row, then, in the branch that only the Jacobian
build keeps, the derivatives of that very row.  The branches on features are decided when the
functions are compiled, so a scene pays for nothing that it does not have.

==========  ===========================================================================
symbol      meaning (paper, Section III; the state is laid out in `physics.layout`)
==========  ===========================================================================
V, T, q     node velocity, segment tension, segment chord over its reference length
L           deployed length; the last segment reaches from its material node to the winch
t           unit tangent q/|q|, from A to B
l, l_ref    unstretched and reference length of a segment;  eps = T/EA
Q           shear force (T_n, T_b of the paper) as a vector, eliminated
tau         Kelvin-Voigt time, of stretching and of bending;  beta, kappa feedback of strain and closure
U, A        velocity of the water at a node, and acceleration of the water particle there
w           integrated place of end B
==========  ===========================================================================

The Jacobian leaves out one thing: how the current changes when a node moves (profile and gridded
currents).  It would couple each node to all segments before it and fill the band; Newton does
without, since a step is short against the time that shear takes to matter.
"""

from __future__ import annotations

import contextlib
import logging
import math
import threading
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numba
import numpy as np

from cablesim.physics.layout import StateLayout
from cablesim.physics.parameters import (
    ADDED_NORMAL,
    ADDED_TANGENTIAL,
    BETA_,
    DRAG_NORMAL,
    DRAG_POINT,
    DRAG_TANGENTIAL,
    EA_,
    EI_,
    FLUID_MASS,
    GRIDDED,
    KAPPA_,
    MASS,
    PROFILE,
    STILL,
    TAU_,
    UNIFORM,
    WET_WEIGHT,
    WINCH_START_,
    Features,
    Parameters,
)

TINY = 1e-30  # keeps 0/0 out of directions; far below any square that matters
FOLDED = 1e-9  # 1 + cos of a joint folded back on itself, where the moment would be infinite

log = logging.getLogger("cablesim")

_f8, _i8 = numba.float64, numba.int64
_READ_ONLY = numba.types.Array(_f8, 1, "C", readonly=True)
SIGNATURE = numba.void(_f8, _READ_ONLY, _READ_ONLY, _f8, _f8[::1], _i8, _i8, _i8, _f8[::1])


class Equations(NamedTuple):
    """Compiled functions of one set of features.

    Both are called as ``function(t, y, yp, c_j, out, base, row_stride, column_stride, buffer)``, the
    buffer being made by `physics.parameters.pack`.

    ``residual`` fills ``out`` with F and ignores c_j and the strides; ``jacobian`` writes the band of
    dF/dY + c_j dF/dY' to ``out[base + i row_stride + j column_stride]``, so that a full matrix and
    band storage are served alike.
    """

    residual: Callable[..., None]
    jacobian: Callable[..., None]


@numba.njit(cache=True, error_model="numpy", inline="never")
def views(buffer):
    """The arrays inside a buffer made by `physics.parameters.pack`."""
    h = buffer[:28].astype(np.int64)
    b = 28
    a, b = b, b + h[0]
    lengths = buffer[a:b]
    a, b = b, b + h[1]
    cable = buffer[a:b]
    a, b = b, b + h[2] * h[3]
    bodies = buffer[a:b].reshape((h[2], h[3]))
    a, b = b, b + h[4]
    constants = buffer[a:b]
    a, b = b, b + h[5]
    winch_breaks = buffer[a:b]
    a, b = b, b + h[6] * h[7] * h[8]
    winch_coefficients = buffer[a:b].reshape((h[6], h[7], h[8]))
    a, b = b, b + h[9]
    breaks_a = buffer[a:b]
    a, b = b, b + h[10] * h[11] * h[12]
    coefficients_a = buffer[a:b].reshape((h[10], h[11], h[12]))
    a, b = b, b + h[13]
    breaks_b = buffer[a:b]
    a, b = b, b + h[14] * h[15] * h[16]
    coefficients_b = buffer[a:b].reshape((h[14], h[15], h[16]))
    a, b = b, b + h[17] * h[18]
    clamps = buffer[a:b].reshape((h[17], h[18]))
    a, b = b, b + h[19]
    times = buffer[a:b]
    a, b = b, b + h[20]
    x = buffer[a:b]
    a, b = b, b + h[21]
    y = buffer[a:b]
    a, b = b, b + h[22]
    z = buffer[a:b]
    velocity = buffer[b:].reshape((h[23], h[24], h[25], h[26], h[27]))
    return Parameters(
        lengths,
        cable,
        bodies,
        constants,
        winch_breaks,
        winch_coefficients,
        breaks_a,
        coefficients_a,
        breaks_b,
        coefficients_b,
        clamps,
        times,
        x,
        y,
        z,
        velocity,
    )


@numba.njit(cache=True, error_model="numpy")
def end_motion(breaks, coefficients, t, place, velocity):
    """Place and velocity of a prescribed end at time t."""
    piece = min(max(np.searchsorted(breaks, t, side="right") - 1, 0), breaks.size - 2)
    dt = t - breaks[piece]
    for c in range(place.size):
        r = coefficients[piece, 5, c]
        v = 0.0
        for k in range(4, -1, -1):
            v = v * dt + r
            r = r * dt + coefficients[piece, k, c]
        place[c] = r
        velocity[c] = v


@numba.njit(cache=True, error_model="numpy")
def bracket(axis, x):
    """Left index, weight of the right neighbour and its slope for linear interpolation, ends held."""
    if axis.size == 1 or x < axis[0]:
        return 0, 0.0, 0.0
    if x >= axis[-1]:
        return axis.size - 2, 1.0, 0.0
    i = np.searchsorted(axis, x, side="right") - 1
    slope = 1.0 / (axis[i + 1] - axis[i])
    return i, (x - axis[i]) * slope, slope


@numba.njit(cache=True, error_model="numpy")
def water_motion(kind, t, place, p, velocity, acceleration):
    """Velocity U of the water at one place, and acceleration dU/dt + (U.grad) U of the particle there."""
    times, x, y, z = p.current_times, p.current_x, p.current_y, p.current_z
    table = p.current_velocity
    velocity[:] = 0.0
    acceleration[:] = 0.0
    if kind == UNIFORM:
        velocity[:] = table[0, 0, 0, 0]
    elif kind == PROFILE:
        k, w, slope = bracket(z, place[place.size - 1])
        below, above = table[0, 0, 0, k], table[0, 0, 0, min(k + 1, z.size - 1)]
        velocity[:] = (1.0 - w) * below + w * above
        acceleration[:] = velocity[velocity.size - 1] * slope * (above - below)
    elif kind == GRIDDED:
        n, wt, st = bracket(times, t)
        i, wx, sx = bracket(x, place[0])
        j, wy, sy = bracket(y, place[1])
        k, wz, sz = bracket(z, place[2])
        for convective in (False, True):  # the velocity takes part in the acceleration
            for corner in range(16):
                dn, di, dj, dk = corner & 1, (corner >> 1) & 1, (corner >> 2) & 1, corner >> 3
                at, ax = (wt if dn else 1.0 - wt), (wx if di else 1.0 - wx)
                ay, az = (wy if dj else 1.0 - wy), (wz if dk else 1.0 - wz)
                u = table[
                    min(n + dn, times.size - 1),
                    min(i + di, x.size - 1),
                    min(j + dj, y.size - 1),
                    min(k + dk, z.size - 1),
                ]
                if not convective:
                    for c in range(velocity.size):
                        velocity[c] += at * ax * ay * az * u[c]
                else:
                    rate = (st if dn else -st) * ax * ay * az
                    rate += velocity[0] * at * (sx if di else -sx) * ay * az
                    rate += velocity[1] * at * ax * (sy if dj else -sy) * az
                    rate += velocity[2] * at * ax * ay * (sz if dk else -sz)
                    for c in range(velocity.size):
                        acceleration[c] += rate * u[c]


@contextlib.contextmanager
def _announced():
    """Say that compilation is under way when it is not over, or loaded from the cache, within a second."""
    timer = threading.Timer(
        1.0,
        log.info,
        ["Compiling the equations for this kind of scene (once, some 5 s; kept for later runs) ..."],
    )
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@cache
def compile_equations(features: Features) -> Equations:
    """Residual and Jacobian for one set of features (compiled at the first call, then cached on disk).

    Parameters
    ----------
    features : Features
        What the scene needs.

    Returns
    -------
    Equations
        The two functions.
    """
    D = features.dimension
    BENDING, DAMPING, POINT_DRAG = features.bending, features.damping, features.point_drag
    CURRENT, FREE_A, FREE_B = features.current, features.free_a, features.free_b
    CLAMP_A, CLAMP_B, WINCH = features.clamp_a, features.clamp_b, features.winch
    CELL = 2 * D + 1
    LOWER, UPPER = StateLayout(D, 1).bandwidths(bending=BENDING)
    MOVING_WATER = CURRENT != STILL
    NEEDS_PLACE = CURRENT in (PROFILE, GRIDDED)

    def build(JACOBIAN):
        def assemble(t, y, yp, c_j, out, base, si, sj, buffer):
            p = views(buffer)
            n = p.lengths.size
            EA, EI, tau = p.constants[EA_], p.constants[EI_], p.constants[TAU_]
            beta, kappa = p.constants[BETA_], p.constants[KAPPA_]
            end = n * CELL  # first row of the closing cell

            lengths, payout_speed = p.lengths, 0.0
            if WINCH:
                deployed, speed_out = np.empty(1), np.empty(1)
                end_motion(p.winch_breaks, p.winch_coefficients, t, deployed, speed_out)
                lengths, payout_speed = p.lengths.copy(), speed_out[0]
                lengths[n - 1] = deployed[0] - p.constants[WINCH_START_]

            # --- chords and tangents -----------------------------------------------------------
            tangent = np.empty((n, D))
            chord = np.empty(n)  # |q|
            for e in range(n):
                iq = e * CELL + D + 1
                square = 0.0
                for c in range(D):
                    square += y[iq + c] * y[iq + c]
                chord[e] = math.sqrt(square) + TINY
                for c in range(D):
                    tangent[e, c] = y[iq + c] / chord[e]

            if not JACOBIAN:
                for i in range(out.size):
                    out[i] = 0.0
            else:
                for i in range(y.size):
                    for k in range(max(i - LOWER, 0), min(i + UPPER + 1, y.size)):
                        out[base + i * si + k * sj] = 0.0

            # --- ends: prescribed places and velocities ------------------------------------------
            r_a, v_a, r_b, v_b = np.zeros(D), np.zeros(D), np.zeros(D), np.zeros(D)
            if not FREE_A:
                end_motion(p.breaks_a, p.coefficients_a, t, r_a, v_a)
            if not FREE_B:
                end_motion(p.breaks_b, p.coefficients_b, t, r_b, v_b)

            # --- segments: tension in (2), compatibility (3), tension row -----------------------
            for e in range(n):
                l, l_ref = lengths[e], p.lengths[e]
                iv = e * CELL
                iT, iq, iv1 = iv + D, iv + D + 1, iv + CELL
                T = y[iT]
                force = T
                if DAMPING:
                    force += tau * yp[iT]
                above = e > 0 or FREE_A  # rows of node e hold its balance of forces
                below = e < n - 1 or FREE_B
                stretching = 0.0
                for c in range(D):
                    stretching += (y[iv1 + c] - y[iv + c]) * tangent[e, c]
                lengthening = 0.0  # l', the material that the winch adds
                if WINCH and e == n - 1:
                    lengthening = payout_speed

                if not JACOBIAN:
                    for c in range(D):
                        # balance of forces (2): the segment pulls both its nodes
                        out[iv + c] -= force * tangent[e, c]
                        out[iv1 + c] += force * tangent[e, c]
                        # compatibility (3), integrated over the segment: linear
                        out[iq + c] = yp[iq + c] - (y[iv1 + c] - y[iv + c]) / l_ref
                    # rate of tension: (3) along t, tied slowly to the chord's length
                    strain = chord[e] * l_ref / l - 1.0
                    out[iT] = yp[iT] / EA - stretching / l - beta * (strain - T / EA)
                    if WINCH:
                        out[iT] += lengthening * (1.0 + T / EA) / l
                else:
                    dforce = 1.0
                    if DAMPING:
                        dforce += c_j * tau
                    for c in range(D):
                        if above:
                            out[base + (iv + c) * si + iT * sj] -= dforce * tangent[e, c]
                        if below:
                            out[base + (iv1 + c) * si + iT * sj] += dforce * tangent[e, c]
                        for d in range(D):
                            g = -tangent[e, c] * tangent[e, d]
                            if c == d:
                                g += 1.0
                            g *= force / chord[e]
                            if above:
                                out[base + (iv + c) * si + (iq + d) * sj] -= g
                            if below:
                                out[base + (iv1 + c) * si + (iq + d) * sj] += g
                        out[base + (iq + c) * si + (iq + c) * sj] = c_j
                        out[base + (iq + c) * si + (iv1 + c) * sj] = -1.0 / l_ref
                        out[base + (iq + c) * si + (iv + c) * sj] = 1.0 / l_ref
                        out[base + iT * si + (iv1 + c) * sj] = -tangent[e, c] / l
                        out[base + iT * si + (iv + c) * sj] = tangent[e, c] / l
                        turning = (y[iv1 + c] - y[iv + c] - stretching * tangent[e, c]) / (chord[e] * l)
                        out[base + iT * si + (iq + c) * sj] = -turning - beta * l_ref / l * tangent[e, c]
                    out[base + iT * si + iT * sj] = (c_j + beta) / EA
                    if WINCH:
                        out[base + iT * si + iT * sj] += lengthening / (l * EA)

            # --- joints: shear from the angular momentum theorem (4), (5) ---------------------------
            # Q_e = t_e x (M_(e+1) - M_e)/|chord|, with M_j = k t_(j-1) x t_j and
            # k = 2 EI/(lbar (1 + t_(j-1).t_j)), written without cross products:
            # joint j adds -k (t_(j-1) - c t_j)/|chord_j| to Q_j,
            # and -k (t_j - c t_(j-1))/|chord_(j-1)| to Q_(j-1)
            # with damping all this at q + tau q': to first order M + tau M', in the same columns
            if BENDING:
                bent, size, dq = tangent, chord, 1.0
                if DAMPING:
                    bent, size, dq = np.empty((n, D)), np.empty(n), 1.0 + c_j * tau
                    for e in range(n):
                        iq = e * CELL + D + 1
                        square = 0.0
                        for c in range(D):
                            bent[e, c] = y[iq + c] + tau * yp[iq + c]
                            square += bent[e, c] * bent[e, c]
                        size[e] = math.sqrt(square) + TINY
                        for c in range(D):
                            bent[e, c] /= size[e]
                first = 0 if CLAMP_A else 1
                last = n if CLAMP_B else n - 1
                before, after = np.empty(D), np.empty(D)
                u, w = np.empty(D), np.empty(D)
                for j in range(first, last + 1):
                    lbar = 0.0
                    if j > 0:
                        lbar += 0.5 * lengths[j - 1]
                    if j < n:
                        lbar += 0.5 * lengths[j]
                    cosine = 0.0
                    for c in range(D):
                        before[c] = bent[j - 1, c] if j > 0 else p.clamps[0, c]
                        after[c] = bent[j, c] if j < n else p.clamps[1, c]
                        cosine += before[c] * after[c]
                    opening = max(1.0 + cosine, FOLDED)
                    k = 2.0 * EI / (lbar * opening)
                    for c in range(D):
                        u[c] = before[c] - cosine * after[c]  # normal to t_j
                        w[c] = after[c] - cosine * before[c]  # normal to t_(j-1)
                    ja, jb = (j - 1) * CELL, j * CELL  # cells of the two segments
                    top = (j > 1 or FREE_A) and j > 0  # node j-1 keeps its balance of forces
                    middle = (j > 0 or FREE_A) and (j < n or FREE_B)
                    bottom = (j < n - 1 or FREE_B) and j < n
                    if not JACOBIAN:
                        if j < n:
                            length = size[j] * p.lengths[j]
                            for c in range(D):
                                Q = -k * u[c] / length
                                out[jb + c] -= Q
                                out[jb + CELL + c] += Q
                        if j > 0:
                            length = size[j - 1] * p.lengths[j - 1]
                            for c in range(D):
                                Q = -k * w[c] / length
                                out[ja + c] -= Q
                                out[ja + CELL + c] += Q
                    else:
                        if j < n:  # Q_j
                            length = size[j] * p.lengths[j]
                            for c in range(D):
                                for d in range(D):
                                    same = 1.0 if c == d else 0.0
                                    # d(k u)/dq_j / |q_j|, and the derivative of 1/length
                                    g = -k / opening * u[c] * u[d]
                                    g -= k * (after[c] * u[d] + cosine * (same - after[c] * after[d]))
                                    g -= k * u[c] * after[d]
                                    g *= -dq / (length * size[j])
                                    col = jb + D + 1 + d
                                    if middle:
                                        out[base + (jb + c) * si + col * sj] -= g
                                    if bottom:
                                        out[base + (jb + CELL + c) * si + col * sj] += g
                                    if j > 0:
                                        g = -k / opening * u[c] * w[d]
                                        g += k * (same - before[c] * before[d] - after[c] * w[d])
                                        g *= -dq / (length * size[j - 1])
                                        col = ja + D + 1 + d
                                        if middle:
                                            out[base + (jb + c) * si + col * sj] -= g
                                        if bottom:
                                            out[base + (jb + CELL + c) * si + col * sj] += g
                        if j > 0:  # Q_(j-1)
                            length = size[j - 1] * p.lengths[j - 1]
                            for c in range(D):
                                for d in range(D):
                                    same = 1.0 if c == d else 0.0
                                    g = -k / opening * w[c] * w[d]
                                    g -= k * (before[c] * w[d] + cosine * (same - before[c] * before[d]))
                                    g -= k * w[c] * before[d]
                                    g *= -dq / (length * size[j - 1])
                                    col = ja + D + 1 + d
                                    if top:
                                        out[base + (ja + c) * si + col * sj] -= g
                                    if middle:
                                        out[base + (jb + c) * si + col * sj] += g
                                    if j < n:
                                        g = -k / opening * w[c] * u[d]
                                        g += k * (same - after[c] * after[d] - before[c] * u[d])
                                        g *= -dq / (length * size[j])
                                        col = jb + D + 1 + d
                                        if top:
                                            out[base + (ja + c) * si + col * sj] -= g
                                        if middle:
                                            out[base + (jb + c) * si + col * sj] += g

            # --- nodes: inertia, weight and drag in the balance of forces (2) -------------------------
            # each half segment is dragged and carries added mass by its own tangent: with the mean of both
            # the error is of first order in l where the cable kinks
            m, weight, fluid = p.cable[MASS], p.cable[WET_WEIGHT], p.cable[FLUID_MASS]
            m_n, m_t = p.cable[ADDED_NORMAL], p.cable[ADDED_TANGENTIAL]
            k_n, k_t = p.cable[DRAG_NORMAL], p.cable[DRAG_TANGENTIAL]
            v, a, v_n = np.empty(D), np.empty(D), np.empty(D)
            U, A, place = np.zeros(D), np.zeros(D), np.empty(D)
            if NEEDS_PLACE:
                for c in range(D):
                    place[c] = r_a[c]
                    if FREE_A:  # positions count back from end B
                        place[c] = y[end + D + c]
                        for e in range(n):
                            place[c] -= y[e * CELL + D + 1 + c] * p.lengths[e]
            elif MOVING_WATER:
                water_motion(CURRENT, t, place, p, U, A)
            for j in range(n + 1):
                iv = j * CELL
                if NEEDS_PLACE and j > 0:
                    for c in range(D):
                        place[c] += y[iv - D + c] * p.lengths[j - 1]
                if (j == 0 and not FREE_A) or (j == n and not FREE_B):
                    continue
                if NEEDS_PLACE:
                    water_motion(CURRENT, t, place, p, U, A)
                lbar = 0.0
                for e in range(max(j - 1, 0), min(j + 1, n)):
                    lbar += 0.5 * lengths[e]
                speed = 0.0
                for c in range(D):
                    v[c] = y[iv + c] - U[c]
                    a[c] = yp[iv + c] - A[c]
                    speed += v[c] * v[c]
                if POINT_DRAG:
                    speed = math.sqrt(speed)

                # what has no direction of its own: the bodies, and of the cable mass and weight
                mass = p.bodies[j, MASS] + lbar * m
                added = p.bodies[j, ADDED_NORMAL] + lbar * m_n
                k_p = p.bodies[j, DRAG_POINT]
                if not JACOBIAN:
                    for c in range(D):
                        row = mass * yp[iv + c] + added * a[c]
                        if POINT_DRAG:
                            row += k_p * speed * v[c]
                        if NEEDS_PLACE:  # the undisturbed water would accelerate what it fills
                            row -= (p.bodies[j, FLUID_MASS] + lbar * fluid) * A[c]
                        out[iv + c] += row
                    out[iv + D - 1] += p.bodies[j, WET_WEIGHT] + lbar * weight
                else:
                    for c in range(D):
                        out[base + (iv + c) * si + (iv + c) * sj] += c_j * (mass + added)
                        if POINT_DRAG:
                            out[base + (iv + c) * si + (iv + c) * sj] += k_p * speed
                            for d in range(D):
                                g = k_p * v[c] * v[d] / (speed + TINY)
                                out[base + (iv + c) * si + (iv + d) * sj] += g

                for e in range(max(j - 1, 0), min(j + 1, n)):
                    half = 0.5 * lengths[e]
                    v_t, a_t = 0.0, 0.0
                    for c in range(D):
                        v_t += v[c] * tangent[e, c]
                        a_t += a[c] * tangent[e, c]
                    speed_n = 0.0
                    for c in range(D):
                        v_n[c] = v[c] - v_t * tangent[e, c]
                        speed_n += v_n[c] * v_n[c]
                    speed_n = math.sqrt(speed_n)
                    across = half * k_n * speed_n
                    along = half * k_t * abs(v_t)
                    softer = half * (m_n - m_t)
                    if not JACOBIAN:
                        pull = along * v_t - softer * a_t
                        for c in range(D):
                            out[iv + c] += across * v_n[c] + pull * tangent[e, c]
                    else:
                        # d t is normal to t, so that d v_t = v_n.d t and d v_n = -(v_n.d t) t - v_t d t
                        turning = (along - across) * v_t - softer * a_t
                        tilt = half * k_n / (speed_n + TINY)
                        for c in range(D):
                            for d in range(D):
                                same = 1.0 if c == d else 0.0
                                tt = tangent[e, c] * tangent[e, d]
                                vv = tilt * v_n[c] * v_n[d]
                                g = across * (same - tt) + vv + (2.0 * along - c_j * softer) * tt
                                out[base + (iv + c) * si + (iv + d) * sj] += g
                                a_n = a[d] - a_t * tangent[e, d]
                                g = tangent[e, c] * ((2.0 * along - across) * v_n[d] - softer * a_n)
                                g += turning * (same - tt) - v_t * vv
                                column = e * CELL + D + 1 + d
                                out[base + (iv + c) * si + column * sj] += g / chord[e]

            # --- ends: the rows of prescribed velocity, and the closing of the cable -------------------
            for c in range(D):
                iw = end + D + c
                if not JACOBIAN:
                    if not FREE_A:
                        out[c] = y[c] - v_a[c]
                    if not FREE_B:
                        out[end + c] = y[end + c] - v_b[c] - kappa * (r_b[c] - r_a[c] - y[iw])
                    out[iw] = yp[iw] - (y[end + c] - v_a[c])
                else:
                    if not FREE_A:
                        out[base + c * si + c * sj] = 1.0
                    if not FREE_B:
                        out[base + (end + c) * si + (end + c) * sj] = 1.0
                        out[base + (end + c) * si + iw * sj] = kappa
                    out[base + iw * si + iw * sj] = c_j
                    out[base + iw * si + (end + c) * sj] = -1.0

        return numba.njit(SIGNATURE, cache=True, error_model="numpy")(assemble)

    with _announced():
        return Equations(residual=build(False), jacobian=build(True))
