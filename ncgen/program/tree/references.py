"""The points from which levers are measured on a tree of bodies: one for all, and others where a long lever would cost digits.

Inertia about a distant point is mostly that of the lever: of the link's own, which decides how its joint turns, as many digits are lost as
the one is larger than the other. From one point to another what is known of a parent is expressed anew (`TreeGeometry.arriving`,
`leaving`), which takes operations; so a link changes the point of its parent only where more than three digits would be lost.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ncgen.model.arithmetic import dot, product
from ncgen.model.elements import Point
from ncgen.model.values import Parameter
from ncgen.symbolic.tree import Tree, TreeLink

MAX_LEVER_RATIO = 1e3
"""How many times the inertia of a link about its joint that of its lever may be."""


def reference_points(tree: Tree, parameters: dict[str, Parameter]) -> list[Point]:
    """For every link the point that it is described from; of a tree's first links the joint of its outermost one."""
    points: list[Point] = []
    starts = _outermost(tree)
    for number, link in enumerate(tree.links):
        candidate = points[link.parent] if link.parent is not None else starts[number]
        points.append(candidate if _is_near(link, candidate, parameters) else joint_point(link))
    return points


def joint_point(link: TreeLink) -> Point:
    """A point that a link turns about, or its first one."""
    return next((screw.point for screw in link.screws if screw.point is not None), link.body.points[0])


def _outermost(tree: Tree) -> Mapping[int, Point]:
    """{first link of a tree: the joint of that tree's outermost link}."""
    root: list[int] = []
    depth: list[int] = []
    outermost: dict[int, int] = {}
    for number, link in enumerate(tree.links):
        root.append(number if link.parent is None else root[link.parent])
        depth.append(0 if link.parent is None else depth[link.parent] + 1)
        if depth[number] >= depth[outermost.setdefault(root[number], number)]:
            outermost[root[number]] = number
    return {first: joint_point(tree.links[last]) for first, last in outermost.items()}


def _is_near(link: TreeLink, point: Point, parameters: dict[str, Parameter]) -> bool:
    """Whether a link's inertia about each of its axes is still seen next to that of its lever, in the initial position."""
    inertia = link.body.inertia
    if inertia is None:
        return True
    mass, center, tensor = inertia.numbers(parameters)
    lever = center - point.initial
    for screw in link.screws:
        if screw.point is not None:
            axis = screw.axis.initial
            arm = np.cross(axis, center - screw.point.initial)
            least = dot(axis, product(tensor, axis)) + mass * dot(arm, arm)
            if mass * dot(lever, lever) * dot(axis, axis) > MAX_LEVER_RATIO * least:
                return False
    return True
