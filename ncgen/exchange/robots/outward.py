"""A model as a robot: what a file of links and joints can say of a mechanism, and what it refuses."""

from __future__ import annotations

from ncgen.compiler import compile
from ncgen.errors import ModelError
from ncgen.exchange.robots.linkage import linkage_of, tree_of
from ncgen.exchange.robots.robot import Robot
from ncgen.model import Model
from ncgen.model.forces import TorsionSpring
from ncgen.solver.joints.joint_space import JointsOfTree, joint_space


def robot_of(model: Model, loops: bool = False) -> Robot:
    """The robot that a model is. Raises ModelError naming what closes a loop, and any load that belongs to no joint.

    loops: it may have some
    """
    refuse_loads(model)
    try:
        space = joint_space(compile(model, backend="numpy"))
    except ModelError:
        if not loops:
            raise
        return linkage_of(model)
    if isinstance(space, JointsOfTree):
        return tree_of(space)
    robot = linkage_of(model)
    if robot.loops and not loops:
        raise ModelError(f"{space.why}; a file of links and joints cannot say it, but SDF (.sdf) and MJCF (.xml) can")
    return robot


def refuse_loads(model: Model) -> None:
    """Raise ModelError naming the first load that no joint has."""
    loads = [load.label for load in (*model.forces, *model.potentials)]
    loads += [spring.label for spring in model.springs if not isinstance(spring, TorsionSpring) or spring.law is not None]
    loads += [getattr(function, "__name__", "callback") for function in model.callbacks]
    if loads:
        raise ModelError(
            f"{model.name}: {loads[0]} is no spring or damper of a joint; a file of links and joints cannot say it, leave it out"
        )
