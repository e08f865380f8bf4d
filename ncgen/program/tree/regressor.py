"""The forces of inverse dynamics by the inertial parameters of the bodies, in which they are linear: joint_regressor(t, q, v, a, p) -> Y.

Ten parameters say what the inertia of a body is, about the origin of its frame and along the axes of that frame, in Pinocchio's order:
the mass m, the first moments m c and the second ones Ixx, Ixy, Iyy, Ixz, Iyz, Izz. A body needs force and moment

    m a + ω̇ × h + ω × (ω × h),    I ω̇ + ω × I ω + h × a

with a the acceleration of the origin against gravity. With everything along the frame's axes the inertia of one parameter alone is 0
but for one or two entries, so most of this vanishes, and what a joint feels of it is its screw times that.
Source: Atkeson, An, Hollerbach, Estimation of inertial parameters of manipulator loads and links (1986).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import Model, bodies
from ncgen.model.arithmetic import weights
from ncgen.program.algebra.space import TENSOR_INDICES, Vector
from ncgen.program.tree.composite import SpatialInertia
from ncgen.program.tree.tree_motion import TreeGeometry, TreeVelocity
from ncgen.symbolic.inertia import standard_inertia
from ncgen.symbolic.tree import Tree

ENTRIES = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
"""Of the tensor, in the order of the parameters."""

NAMES = ("m", "mx", "my", "mz", *(f"I{'xyz'[i]}{'xyz'[j]}" for i, j in ENTRIES))
"""Of the parameters of a body."""

ROUNDING = 1e-15
"""Shares of directions in a frame's axes that are smaller are 0."""


class RegressorFrame(NamedTuple):
    """A body's frame in the initial position. rotation (3, 3): its axes as columns; position (3,): its origin (m)."""

    rotation: np.ndarray
    position: np.ndarray


def frames_of(model: Model, tree: Tree) -> list[RegressorFrame]:
    """Of every link: the frame of its body in a robot's file, else its first point and the global axes."""
    frames = []
    for link in tree.links:
        named = next((frame for frame in model.frames.values() if frame.body == link.body.name), None)
        frames.append(RegressorFrame(named.rotation, named.position) if named else RegressorFrame(np.eye(3), link.body.points[0].initial))
    return frames


def regressor(
    geometry: TreeGeometry, velocity: TreeVelocity, gravity: Vector, accelerations: Sequence[int], frames: Sequence[RegressorFrame]
) -> dict[int, dict[int, int]]:
    """{rate of the tree: {column: node}}, ten columns a link.

    accelerations: of the tree's rates; frames: of the links
    """
    space, columns = geometry.space, {}
    units = _units(geometry)
    moved = geometry.twists(accelerations)
    for number, frame in enumerate(frames):
        axes, origin = _frame(geometry, number, frame)
        (turning, along), (change, lift) = velocity.twists[number], velocity.changes[number]
        change = space.add(change, moved[number][0])
        arm = space.sub(origin, geometry.reference[number])
        lift = space.sum((lift, moved[number][1], space.cross(turning, along), space.cross(change, arm)))
        lift = space.sub(space.add(lift, space.cross(turning, space.cross(turning, arm))), gravity)
        motion = [_along(geometry, axes, vector) for vector in (turning, lift, change)]
        loads = [unit.load(space, *motion) for unit in units]
        for home in geometry.tree.chain(number):
            lever = space.sub(origin, geometry.reference[home])
            for k in geometry.own[home]:
                column = geometry.columns[k]
                axis, slide = (_along(geometry, axes, v) for v in (column.axis, space.add(column.along, space.cross(column.axis, lever))))
                nodes = (space.graph.add(space.dot(axis, moment), space.dot(slide, force)) for force, moment in loads)
                columns.setdefault(k, {}).update(enumerate(nodes, len(NAMES) * number))
    return columns


def _units(geometry: TreeGeometry) -> list[SpatialInertia]:
    """The inertia that one parameter alone says, for each."""
    zero, one = geometry.space.graph.const(0.0), geometry.space.graph.const(1.0)
    nothing = [zero] * 10
    inertias = []
    for k in range(len(NAMES)):
        values = [*nothing[:k], one, *nothing[k + 1 :]]
        by_entry = dict(zip(ENTRIES, values[4:], strict=True))
        xx, yy, zz, xy, xz, yz = (by_entry[entry] for entry in TENSOR_INDICES)
        inertias.append(SpatialInertia(values[0], (values[1], values[2], values[3]), (xx, yy, zz, xy, xz, yz)))
    return inertias


def _frame(geometry: TreeGeometry, number: int, frame: RegressorFrame) -> tuple[list[Vector], Vector]:
    """The axes of a link's frame, and its origin, from the elements that the body has."""
    space, body = geometry.space, geometry.tree.links[number].body
    basis = body.basis if body.inertia else bodies.choose_basis(body)
    if lengths := [e.name for e in basis[1:] if e.is_parametric]:
        raise ModelError(f"body {body.name}: {lengths[0]} depends on parameters; the regressor needs directions that are numbers")
    whole = bodies.Inertia(mass=1.0, com=tuple(basis[0].initial.tolist()), tensor=np.eye(3), basis=basis)
    standard = standard_inertia(replace(body, inertia=whole), geometry.lines.equations.model.parameters)
    forms = [
        [(weight, components, np.array([c.initial for c in components])) for weight, components in form] for form in standard.directions
    ]
    now = [space.sum(space.times(space.graph.const(w), _nodes(geometry, components)) for w, components, _ in form) for form in forms]
    initial = [sum((w * values for w, _, values in form), np.zeros(3)) for form in forms]
    if standard.crossed:
        now.append(space.cross(now[1], now[2]))
        initial.append(np.cross(initial[1], initial[2]))

    def direction_of(direction: np.ndarray) -> Vector:
        shares = weights(initial[1:], direction)
        scale = np.max(np.abs(shares), initial=0.0)
        return space.sum(
            space.times(space.graph.const(float(coefficient)), d)
            for coefficient, d in zip(shares, now[1:], strict=True)
            if abs(coefficient) > ROUNDING * scale
        )

    return [direction_of(frame.rotation[:, k]) for k in range(3)], space.add(now[0], direction_of(frame.position - initial[0]))


def _nodes(geometry: TreeGeometry, components: Sequence) -> Vector:
    x, y, z = map(geometry.node, components)
    return x, y, z


def _along(geometry: TreeGeometry, axes: Sequence[Vector], vector: Vector) -> Vector:
    """A vector's components along the axes."""
    x, y, z = (geometry.space.dot(axis, vector) for axis in axes)
    return x, y, z
