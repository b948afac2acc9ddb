"""Everything that can be said about a run, from its states.

Depends on: scene, mesh, physics, history, basis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cablesim.mesh import Mesh
from cablesim.motion import evaluate_pieces
from cablesim.physics.equations import water_motion
from cablesim.physics.model import CableModel
from cablesim.physics.parameters import (
    ADDED_NORMAL,
    ADDED_TANGENTIAL,
    DRAG_NORMAL,
    DRAG_POINT,
    DRAG_TANGENTIAL,
    FLUID_MASS,
    MASS,
    STILL,
    WET_WEIGHT,
)
from cablesim.scene import Scene
from cablesim.trajectory.basis import local_basis
from cablesim.trajectory.history import History

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Quantities:
    """Everything that can be said about a history; each property is computed when first asked for.

    Those that end in the dataset are described in `variables`.
    """

    scene: Scene
    mesh: Mesh
    model: CableModel
    history: History

    @cached_property
    def times(self) -> Array:
        return self.history.times

    @cached_property
    def on_winch(self) -> bool:
        return self.scene.winch is not None

    @cached_property
    def last_segment(self) -> NDArray[np.int64]:
        """Index of the segment that ends at B, shape (time, 1)."""
        return self.history.segments[:, None] - 1

    @cached_property
    def lengths(self) -> Array:
        """Unstretched lengths, shape (time, segment), or (1, segment) where they do not change."""
        if not self.on_winch:
            return self.mesh.lengths[None]
        index = np.arange(self.mesh.segments)
        out = self.history.deployed[:, :1] - self.mesh.nodes[self.last_segment]
        return np.where(
            index < self.last_segment, self.mesh.lengths, np.where(index == self.last_segment, out, 0.0)
        )

    @cached_property
    def node_lengths(self) -> Array:
        """Half of both neighbouring segments, shape (time or 1, node)."""
        halves = np.pad(0.5 * self.lengths, ((0, 0), (1, 1)))
        return halves[:, 1:] + halves[:, :-1]

    @cached_property
    def bodies(self) -> Array:
        """What is attached to each node and in the water, shape (time or 1, node, 8)."""
        bodies = self.model.parameters.bodies
        if not self.on_winch:
            return bodies[None]
        return np.where((np.arange(len(bodies)) <= self.last_segment)[..., None], bodies, 0.0)

    def lumped(self, column: int) -> Array:
        """A quantity of `physics.parameters`, cable and bodies, of each node, shape (time or 1, node)."""
        return self.node_lengths * self.model.parameters.cable[column] + self.bodies[..., column]

    @cached_property
    def chords(self) -> Array:
        lengths = self.model.parameters.lengths[:, None]
        chords = self.model.frame.vectors_out(lengths * self.model.layout.chord(self.history.y))
        if self.on_winch:
            chords[np.arange(self.mesh.segments) > self.last_segment] = 0.0
        return chords

    @cached_property
    def position(self) -> Array:
        from_a = np.zeros((self.times.size, self.mesh.segments + 1, 3))
        np.cumsum(self.chords, axis=1, out=from_a[:, 1:])
        if self.scene.end_a.motion is not None:
            return from_a + self._end_position("a")[:, None]
        end_b = self.model.frame.places_out(self.model.layout.end_place(self.history.y))
        return from_a + (end_b - from_a[:, -1])[:, None]

    @cached_property
    def velocity(self) -> Array:
        velocity = self.model.frame.vectors_out(self.model.layout.node_velocity(self.history.y))
        if self.on_winch:  # the material leaves the winch with V_n - L' (1 + eps) t
            flow = (self.history.deployed[:, 1] * self._winch_stretch)[:, None] * self.tangent[:, -1]
            velocity[self._at_winch] = np.repeat(velocity[:, -1] - flow, self._at_winch.sum(axis=1), axis=0)
        return velocity

    @cached_property
    def acceleration(self) -> Array:
        rates = self.model.frame.vectors_out(self.model.layout.node_velocity(self.history.yp))
        for node, end in ((0, self.scene.end_a), (-1, self.scene.end_b)):
            if end.motion is not None:  # the integrator's rate of an algebraic unknown is only an estimate
                rates[:, node] = self.model.frame.vectors_out(self._end_motion("a" if node == 0 else "b", 2))
        if self.on_winch:
            rates[self._at_winch] = np.repeat(
                rates[:, -1] - self._flow_acceleration, self._at_winch.sum(axis=1), axis=0
            )
        return rates

    @cached_property
    def _at_winch(self) -> NDArray[np.bool_]:
        """Nodes that are drawn together at the winch, shape (time, node)."""
        return np.arange(self.mesh.segments + 1) > self.last_segment

    @cached_property
    def _winch_stretch(self) -> Array:
        return 1.0 + self.strain_tension[:, -1] / self.scene.cable.axial_stiffness

    @cached_property
    def _flow_acceleration(self) -> Array:
        """What the material's velocity at the winch loses to that of the winch, per second.

        d/dt (V_n - L' (1 + eps) t) follows the winch; the material there moves on with L' along s.
        """
        speed, gain = self.history.deployed[:, 1, None], self.history.deployed[:, 2, None]
        tangent, stretch = self.tangent[:, -1], self._winch_stretch[:, None]
        rate = self.model.frame.vectors_out(self.model.layout.chord(self.history.yp)[:, -1])
        size = np.linalg.norm(self.model.layout.chord(self.history.y)[:, -1], axis=1)[:, None]
        turning = (rate - np.einsum("tc,tc->t", rate, tangent)[:, None] * tangent) / size
        last = np.take_along_axis(self.lengths, self.last_segment, axis=1)
        free = np.take_along_axis(self.velocity, self.last_segment[..., None], axis=1)[:, 0]
        along = (self.velocity[:, -1] - free) / last
        return stretch * (gain * tangent + speed * turning) + speed * along

    @cached_property
    def tangent(self) -> Array:
        chord = self.model.frame.vectors_out(self.model.layout.chord(self.history.y))
        return chord / np.sqrt(np.einsum("tec,tec->te", chord, chord))[..., None]

    @cached_property
    def node_tangent(self) -> Array:
        t = self.tangent
        mean = np.empty((t.shape[0], t.shape[1] + 1, 3))
        mean[:, 0], mean[:, -1] = t[:, 0], t[:, -1]
        np.add(t[:, 1:], t[:, :-1], out=mean[:, 1:-1])
        mean[:, 1:-1] /= np.maximum(np.linalg.norm(mean[:, 1:-1], axis=-1), 1e-12)[..., None]
        return mean

    @cached_property
    def strain_tension(self) -> Array:
        return self.model.layout.tension(self.history.y)

    @cached_property
    def tension(self) -> Array:
        """Axial force with its damping part: what the segments pull with."""
        return self.strain_tension + self.scene.damping_time * self.model.layout.tension(self.history.yp)

    @cached_property
    def shear(self) -> Array:
        """Shear vectors Q (time, segment, 3); see the joints in `physics.equations`."""
        result = np.zeros_like(self.tangent)
        if not self.model.features.bending:
            return result
        layout, history = self.model.layout, self.history
        damped = layout.chord(history.y) + self.scene.damping_time * layout.chord(history.yp)
        before, after, stiffness = self._joints(damped)
        cosine = np.einsum("tjc,tjc->tj", before, after)
        moment = (stiffness / np.maximum(1.0 + cosine, 1e-9))[..., None]
        pull_after = -moment * (before - cosine[..., None] * after)  # of joint j on segment j
        pull_before = -moment * (after - cosine[..., None] * before)  # and on segment j-1
        result += pull_after[:, :-1] + pull_before[:, 1:]
        sizes = np.sqrt(np.einsum("tec,tec->te", self.chords, self.chords))
        return result / np.maximum(sizes, 1e-30)[..., None]

    def _joints(self, chord: Array) -> tuple[Array, Array, Array]:
        """Tangents before and after each of the n+1 joints, and 2 EI/lbar (0 at a ball joint).

        `chord` (time, segment, D) are segment vectors of any length.
        """
        t = self.model.frame.vectors_out(chord)
        t /= np.sqrt(np.einsum("tec,tec->te", t, t))[..., None]
        clamps = self.model.frame.vectors_out(self.model.parameters.clamps)
        shape = (t.shape[0], 1, 3)
        before = np.concatenate((np.broadcast_to(clamps[0], shape), t), axis=1)
        after = np.concatenate((t, np.broadcast_to(clamps[1], shape)), axis=1)
        after[self._at_winch] = clamps[1]
        stiffness = np.zeros((len(self.node_lengths), t.shape[1] + 1))
        np.divide(
            2.0 * self.scene.cable.bending_stiffness,
            self.node_lengths,
            out=stiffness,
            where=self.node_lengths > 0.0,
        )
        stiffness[:, 0] *= float(self.model.features.clamp_a)
        if not self.model.features.clamp_b:
            stiffness = np.where(self._at_winch, 0.0, stiffness)
        return before, after, stiffness

    @cached_property
    def theta(self) -> Array:
        return -np.arcsin(np.clip(self.tangent[..., 1], -1.0, 1.0))

    @cached_property
    def phi(self) -> Array:
        t = self.tangent
        return np.unwrap(np.unwrap(np.arctan2(-t[..., 2], t[..., 0]), axis=1), axis=0)

    @cached_property
    def shear_normal(self) -> Array:
        return np.einsum("tec,tec->te", self.shear, local_basis(self.tangent)[0])

    @cached_property
    def shear_binormal(self) -> Array:
        return np.einsum("tec,tec->te", self.shear, local_basis(self.tangent)[1])

    @cached_property
    def velocity_tangential(self) -> Array:
        return np.einsum("tnc,tnc->tn", self.velocity, self.node_tangent)

    @cached_property
    def _node_basis(self) -> tuple[Array, Array]:
        return local_basis(self.node_tangent)

    @cached_property
    def velocity_normal(self) -> Array:
        return np.einsum("tnc,tnc->tn", self.velocity, self._node_basis[0])

    @cached_property
    def velocity_binormal(self) -> Array:
        return np.einsum("tnc,tnc->tn", self.velocity, self._node_basis[1])

    @cached_property
    def end_tension(self) -> Array:
        tension = self.tension[:, [0, -1]]
        if self.on_winch:  # of the outlet itself: the middle of its segment moves to and fro with the nodes
            tension[:, 1] = -np.einsum("tc,tc->t", self.end_force[:, 1], self.tangent[:, -1])
        return tension

    @cached_property
    def end_force(self) -> Array:
        """Balance of forces (2) of the two end nodes, solved for what holds them."""
        force = np.empty((self.times.size, 2, 3))
        for k, (node, segment, sign) in enumerate(((0, 0, 1.0), (-1, -1, -1.0))):
            pull = self.tension[:, segment, None] * self.tangent[:, segment] + self._end_shear[:, k]
            force[:, k] = sign * pull - self._end_load(node)
        return force

    @cached_property
    def _end_shear(self) -> Array:
        """Shear (time, 2, 3) of the segments at A and B."""
        last = np.take_along_axis(self.shear, self.last_segment[..., None], axis=1)
        return np.concatenate((self.shear[:, :1], last), axis=1)

    def _end_load(self, node: int) -> Array:
        """Inertia, drag and weight (time, 3) of an end node, as in the node loop of `physics.equations`."""
        p = self._loads_at_ends[:, node].T[:, :, None]
        m = self.tangent[:, node]  # an end has one half segment only
        water, water_rate = self._water(node)
        v, a = self.velocity[:, node] - water, self.acceleration[:, node] - water_rate
        v_t = np.einsum("tc,tc->t", v, m)[:, None]
        a_t = np.einsum("tc,tc->t", a, m)[:, None]
        v_n = v - v_t * m
        load = p[MASS] * self.acceleration[:, node] + p[ADDED_NORMAL] * a
        load -= (p[ADDED_NORMAL] - p[ADDED_TANGENTIAL]) * a_t * m + p[FLUID_MASS] * water_rate
        load += p[DRAG_NORMAL] * np.linalg.norm(v_n, axis=1, keepdims=True) * v_n
        load += p[DRAG_TANGENTIAL] * np.abs(v_t) * v_t * m
        load += p[DRAG_POINT] * np.linalg.norm(v, axis=1, keepdims=True) * v
        return load + p[WET_WEIGHT] * np.array([0.0, 0.0, 1.0])

    @cached_property
    def _loads_at_ends(self) -> Array:
        """Rows (time or 1, 2, 8) of the nodes at A and B."""
        last = np.take_along_axis(self.lengths, self.last_segment[: len(self.lengths)], axis=1)
        halves = 0.5 * np.concatenate((self.lengths[:, :1], last), axis=1)
        # beyond the outlet of a winch there are no bodies
        return halves[..., None] * self.model.parameters.cable + self.bodies[:, [0, -1]]

    def _water(self, node: int) -> tuple[Array, Array]:
        """Velocity and acceleration (time, 3) of the water at one node."""
        frame, p, kind = self.model.frame, self.model.parameters, self.model.features.current
        velocity, rate = np.zeros((2, self.times.size, frame.dimension))
        if kind != STILL:
            places = frame.places_in(self.position[:, node])
            for k, t in enumerate(self.times):
                water_motion(kind, t, places[k], p, velocity[k], rate[k])
        return frame.vectors_out(velocity), frame.vectors_out(rate)

    @cached_property
    def deployed_length(self) -> Array:
        return self.history.deployed[:, 0]

    @cached_property
    def payout_speed(self) -> Array:
        return self.history.deployed[:, 1]

    @cached_property
    def deployed_mass(self) -> Array:
        return self.lumped(MASS).sum(axis=1)

    @cached_property
    def winch_event_time(self) -> Array:
        return np.array([event.time for event in self.history.events])

    @cached_property
    def winch_event_change(self) -> Array:
        return np.array([event.change for event in self.history.events], dtype=np.int32)

    @cached_property
    def winch_event_energy_change(self) -> Array:
        return np.array([event.energy_change for event in self.history.events])

    @cached_property
    def winch_event_momentum_change(self) -> Array:
        return np.array([event.momentum_change for event in self.history.events])

    @cached_property
    def attachment_position(self) -> Array:
        nodes = self.mesh.attachment_nodes
        there = nodes <= self.last_segment if self.on_winch else True
        return np.where(np.expand_dims(there, -1), self.position[:, nodes], np.nan)

    @cached_property
    def marker_position(self) -> Array:
        s = self.scene.output.markers
        last = self.last_segment if self.on_winch else self.mesh.segments - 1
        segment = np.clip(np.searchsorted(self.mesh.nodes, s, side="right") - 1, 0, last)
        segment = np.broadcast_to(segment, (self.times.size, s.size))
        lengths = np.broadcast_to(self.lengths, (self.times.size, self.mesh.segments))
        share = (s - self.mesh.nodes[segment]) / np.take_along_axis(lengths, segment, axis=1)
        left = np.take_along_axis(self.position, segment[..., None], axis=1)
        right = np.take_along_axis(self.position, segment[..., None] + 1, axis=1)
        places = left + share[..., None] * (right - left)
        return np.where(share[..., None] <= 1.0 + 1e-9, places, np.nan)

    @cached_property
    def kinetic_energy(self) -> Array:
        square = np.einsum("tnc,tnc->tn", self.velocity, self.velocity)
        twice = np.sum(square * (self.lumped(MASS) + self.lumped(ADDED_NORMAL)), axis=1)
        # along a segment, the added mass of its two halves is less
        cable = self.model.parameters.cable
        softer = 0.5 * self.lengths * (cable[ADDED_NORMAL] - cable[ADDED_TANGENTIAL])
        for velocity in (self.velocity[:, :-1], self.velocity[:, 1:]):
            twice -= np.sum(softer * np.einsum("tec,tec->te", velocity, self.tangent) ** 2, axis=1)
        return 0.5 * twice

    @cached_property
    def potential_energy(self) -> Array:
        return np.sum(self.position[..., 2] * self.lumped(WET_WEIGHT), axis=1)

    @cached_property
    def elastic_energy(self) -> Array:
        return np.sum(self.strain_tension**2 * self.lengths, axis=1) / (
            2.0 * self.scene.cable.axial_stiffness
        )

    @cached_property
    def bending_energy(self) -> Array:
        if not self.model.features.bending:
            return np.zeros(self.times.size)
        before, after, stiffness = self._joints(self.model.layout.chord(self.history.y))
        opening = np.maximum(1.0 + np.einsum("tjc,tjc->tj", before, after), 1e-9)
        return -np.sum(np.log(0.5 * opening) * stiffness, axis=1)

    @cached_property
    def closure_error(self) -> Array:
        if self.scene.end_b.motion is None or self.scene.end_a.motion is None:
            return np.zeros(self.times.size)
        return np.linalg.norm(self.position[:, -1] - self._end_position("b"), axis=1)

    def _end_position(self, name: str) -> Array:
        return self.model.frame.places_out(self._end_motion(name, 0))

    def _end_motion(self, name: str, derivative: int) -> Array:
        """Motion of an end as integrated: a driven end has left the motion of the scene."""
        breaks = getattr(self.model.parameters, f"breaks_{name}")
        coefficients = getattr(self.model.parameters, f"coefficients_{name}")
        piece = np.clip(np.searchsorted(breaks, self.times, side="right") - 1, 0, len(coefficients) - 1)
        return evaluate_pieces(coefficients[piece], self.times - breaks[piece], derivative)
