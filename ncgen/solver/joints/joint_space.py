"""A mechanism over the rates of its joints: what robotics calls the basics.

Natural coordinates stay what positions are described by. Rates v are those of the joints in the order of `JointSpace.rates`; they are
called
like the coordinate that follows them (a hinge's angle, a slider's distance), else like the body that the joint carries. A body that moves
freely has the velocity of its first point and its angular velocity, in global axes. Where loops are closed the rates are as many as the
mechanism has degrees of freedom, and all others follow (`ncgen.solver.joints.joint_loops`).
Source: Featherstone, Rigid Body Dynamics Algorithms (2008); natural coordinates give a joint's screw as (u, r × u) at once.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.shared_docstrings import shares
from ncgen.program.ir.blocks import Program
from ncgen.program.tree.joint_programs import Made, assemble_joint_space
from ncgen.solver import argument_checks
from ncgen.solver.joints.joint_dynamics import JointDynamics
from ncgen.solver.joints.joint_names import followed_by, names_of
from ncgen.symbolic.tree import Tree, spanning_tree


def joint_space(kernels: Kernels, p: argument_checks.ArrayOrNamed | None = None) -> JointSpace:
    """Make the joint space of a mechanism: mass matrix, inverse and forward dynamics, and Jacobians in joint coordinates.

    It is made once for every kernels object.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    p : array_like, shape (n_p,), or {name: value}, optional
        Parameters. Default: the model's.

    Returns
    -------
    JointSpace
        Functions of joint positions and velocities.

    Raises
    ------
    ModelError
        Where a body has no rotational inertia that a tree needs, or no tree of bodies moves as the constraints allow.
    """
    space = argument_checks.checked_kernels(kernels).remember("joint space", (), lambda: _made(kernels))
    return space if p is None else space.at(p)


def _made(kernels: Kernels) -> JointSpace:
    from ncgen.solver.joints.joint_loops import JointsInLoops

    tree = spanning_tree(kernels.model)
    if not tree.dof:
        raise ModelError(f"{kernels.name}: no body defines an orientation, which takes 2 directions in space; joint space is undefined")
    try:
        if tree.loose:
            raise ModelError(f"{kernels.name}: joint space needs the orientation of every body; {tree.loose[0].name} does not define one")
        followed = followed_by(kernels, tree)
    except ModelError as why:  # loops, or what belongs to no joint
        return JointsInLoops(kernels, tree, why)
    return JointsOfTree(kernels, tree, followed)


class JointSpace(JointDynamics):
    """A mechanism over the rates of its joints.

    rates: their names; coordinates: names of the joints that have one; n: how many rates there are
    Positions q are ncgen's natural coordinates (n_q,), consistent, as `position` gives them; with NumPy kernels leading axes are batches,
    with compiled ones states of a batch go through one after the other. Parameters have their defaults, or are those of `at`. Forces are N
    along what slides, N m along what turns.
    """


@shares()
class JointsOfTree(JointSpace):
    """Of an open tree: every joint moves by itself.

    followed: {relative coordinate: (rate, its share)}
    """

    kind = "joint"

    def __init__(self, kernels: Kernels, tree: Tree, followed: dict[int, tuple[int, float]]) -> None:
        self.followed = followed
        super().__init__(kernels, tree, names_of(kernels, tree, followed))

    def placed(self, x: np.ndarray) -> np.ndarray:
        return self._functions("joint_position", 0.0, self._over_rates(x, "x"), self.p)

    def _spread(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.eye(self.n), np.zeros(self.n)

    def _spread_rate(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.zeros((self.n, self.n))

    def _own(self) -> Mapping[int, int]:
        return {c: k for c, (k, _) in self.followed.items()}

    def made(self, group: Made) -> dict[str, Program]:
        return assemble_joint_space(self.kernels.programs.equations, self.followed, group)
