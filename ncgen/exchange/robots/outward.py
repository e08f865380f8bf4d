"""A model as a robot: what a file of links and joints can say of a mechanism whose bodies are an open tree.

Every link's frame stands along the global axes in the initial position, at the joint that carries it, so axes and inertias are written as
they are. Joints have the names, signs and zeros of the model's coordinates; parameters have their defaults.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ncgen.compiler import compile
from ncgen.errors import ModelError
from ncgen.exchange.robots.linkage import linkage_of
from ncgen.exchange.robots.looks import shapes_on
from ncgen.exchange.robots.model_loads import acting, gravity_of, mass_of, origin_of
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Joint, Link, Robot
from ncgen.model import Model
from ncgen.model.arithmetic import unit
from ncgen.model.forces import TorsionSpring
from ncgen.model.pairs import Screw
from ncgen.solver.joints.joint_space import JointsOfTree, joint_space
from ncgen.symbolic.tree import TreeLink

ROOT = "world"

ROUNDING = 1e-15
"""A coordinate that begins this near to 0 begins there (rad; m)."""


def robot_of(model: Model, loops: bool = False) -> Robot:
    """The robot that a model is. Raises ModelError naming what closes a loop, and any load that belongs to no joint.

    loops: it may have some (`ncgen.exchange.robots.linkage`)
    """
    refuse_loads(model)
    try:
        space = joint_space(compile(model, backend="numpy"))
    except ModelError:
        if not loops:
            raise
        return linkage_of(model)
    if isinstance(space, JointsOfTree):
        return _Teller(space).robot()
    robot = linkage_of(model)
    if robot.loops and not loops:
        raise ModelError(f"{space.why}; a file of links and joints cannot say it, but SDF (.sdf) and MJCF (.xml) can")
    return robot


class _Teller:
    def __init__(self, space: JointsOfTree) -> None:
        self.space, self.model = space, space.kernels.model
        self.names = [link.body.name for link in self.space.tree.links]
        self.root = next(name for name in (ROOT, f"{ROOT}_", f"{ROOT}__") if name not in self.names)
        self.coordinates = {k: (c, factor) for c, (k, factor) in self.space.followed.items()}
        self.origins = [origin_of(link) for link in self.space.tree.links]

    def robot(self) -> Robot:
        tree = self.space.tree
        links = [Link(name=self.root, mass=None, shapes=shapes_on(self.model, self.model.ground, np.zeros(3)))]
        for link, origin in zip(tree.links, self.origins, strict=True):
            links.append(
                Link(name=link.body.name, mass=mass_of(self.model, link.body, origin), shapes=shapes_on(self.model, link.body, origin))
            )
        joints = [self._joint(number) for number in range(len(tree.links))]
        return Robot(
            name=self.model.name, links={link.name: link for link in links}, joints=tuple(joints), gravity=gravity_of(self.model)
        ).ordered()

    def _joint(self, number: int) -> Joint:
        link = self.space.tree.links[number]
        parent = self.root if link.parent is None else self.names[link.parent]
        position = self.origins[number] - (0.0 if link.parent is None else self.origins[link.parent])
        kind, axis = self._kind(link)
        coordinate, factor = None, 1.0
        if kind in ("revolute", "prismatic"):
            (rate,) = self.space.tree.rates[number]
            coordinate, factor = self.coordinates.get(rate, (None, 1.0))
        axis = axis if factor > 0 else -axis
        name, placement, more = f"joint_{link.body.name}", Placement(position=position), dict[str, Any]()
        if coordinate is not None:
            name, start = self.space.kernels.coordinates[coordinate], float(self.space.kernels.q0[coordinate])
            start = 0.0 if abs(start) < ROUNDING else start
            placement = _turned(axis, -start, position) if kind == "revolute" else Placement(position=position - start * axis)
            more |= acting(self.model, name)
        return Joint(name=name, kind=kind, parent=parent, child=link.body.name, placement=placement, axis=axis, **more)

    def _kind(self, link: TreeLink) -> tuple[str, np.ndarray]:
        """The joint that carries a link, by its degrees of freedom, and its axis."""
        screws = link.screws
        turning = [screw for screw in screws if screw.point]
        if len(screws) == 1:
            return ("revolute" if turning else "prismatic"), unit(screws[0].axis.initial)
        if len(screws) == 3 and len(turning) == 1:
            return "planar", unit(turning[0].axis.initial)
        kind = {(0, 0): "fixed", (3, 3): "spherical", (6, 3): "floating"}.get((len(screws), len(turning)))
        if kind is None:
            raise ModelError(
                f"{self.model.name}: body {link.body.name} has {_freedoms(screws)} relative to its parent; a file of links and "
                "joints has hinges, sliders, balls, planes and welds: put a body without mass between"
            )
        return kind, np.array([0.0, 0.0, 1.0])


def refuse_loads(model: Model) -> None:
    """Raise ModelError naming the first load that no joint has."""
    loads = [load.label for load in (*model.forces, *model.potentials)]
    loads += [spring.label for spring in model.springs if not isinstance(spring, TorsionSpring) or spring.law is not None]
    loads += [getattr(function, "__name__", "callback") for function in model.callbacks]
    if loads:
        raise ModelError(
            f"{model.name}: {loads[0]} is no spring or damper of a joint; a file of links and joints cannot say it, leave it out"
        )


def _turned(axis: np.ndarray, angle: float, position: np.ndarray) -> Placement:
    """A frame turned about an axis."""
    half = angle / 2
    return Placement.of_quaternion(position, np.array([math.cos(half), *(math.sin(half) * axis)]))


def _freedoms(screws: tuple[Screw, ...]) -> str:
    turning = sum(screw.point is not None for screw in screws)
    return f"{len(screws)} degrees of freedom ({turning} rotations)"
