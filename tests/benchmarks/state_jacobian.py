"""∂ẏ/∂y of the state derivative on independent coordinates: exact by the tangent kernels or by CasADi, and by differences.

The reference knows neither: the emitted programs of the state derivative, evaluated with 50 digits on both sides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mpmath
import numpy as np

from benchmarks.exact_motion import exact_motion
from benchmarks.rivals.casadi_tangents import with_tangents
from ncgen.comparisons.rivals.base import Rival, own_start
from ncgen.comparisons.rivals.differences import central, forward, jacobian
from ncgen.comparisons.rivals.exact import DIGITS
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import CompiledKernels
from ncgen.report.clock import repeated
from ncgen.solver.engines.capabilities import is_emitted
from ncgen.solver.engines.partition_dynamics import dynamics as dynamics_in_c
from ncgen.solver.formalisms.coordinate_partitioning import StepStart, motion, motion_at
from ncgen.solver.formalisms.dynamics_jacobian import partitioned_jacobian

if TYPE_CHECKING:
    from ncgen.program.motions.dynamics import DynamicsPrograms

SPEED = 1.0
"""Independent velocities at which it is evaluated."""


class StateJacobian:
    """One state of a mechanism, in general position, and all ways to ∂ẏ/∂y there; y = [ż; z]."""

    def __init__(self, kernels: CompiledKernels) -> None:
        self.kernels = kernels
        self.q, self.partitions = own_start(kernels)
        self.z = self.partitions.velocity.independent
        self.y = np.concatenate([np.full(len(self.z), SPEED), self.q[self.z]])
        self.start = StepStart(0.0, self.q, np.zeros(kernels.n), kernels.p0)

    @property
    def possible(self) -> bool:
        """Whether the state derivative is emitted at all, and has a state."""
        return len(self.z) > 0 and is_emitted(self.kernels, self.partitions)

    def derivative(self, y: np.ndarray) -> np.ndarray:
        """ẏ by the generated C kernels and the linear algebra of Python."""
        count = len(self.z)
        now = motion(self.kernels, self.partitions, self.start, 0.0, y[count:], y[:count])
        return np.concatenate([now.qdd[self.z], now.qd[self.z]])

    def by_tangents(self, kernels: Kernels) -> np.ndarray:
        """By the implicit function theorem, on the tangents of the kernels given."""
        here = motion_at(self.kernels, self.partitions.velocity, 0.0, self.q, self.y[: len(self.z)], self.kernels.p0)
        return partitioned_jacobian(kernels, self.partitions, here)[:-1, :-1]

    def in_c(self) -> np.ndarray:
        """The same by the C runtime, which writes the rows of the accelerations."""
        count, p = len(self.z), self.kernels.p0
        rows = dynamics_in_c(self.kernels, self.partitions, "dense", self.q, p).jacobian(0.0, self.q, self.y[:count], p)
        return np.vstack([rows, np.eye(count, 2 * count)])

    def rivals(self) -> list[Rival]:
        ways = {"generated tangents, in C": self.in_c, "generated tangents": lambda: self.by_tangents(self.kernels)}
        if (automatic := with_tangents(self.kernels)) is not None:
            ways["CasADi tangents"] = lambda: self.by_tangents(automatic)
        for name, slope in (("finite differences, 2 points", forward), ("finite differences, 3 points", central)):
            ways[name] = lambda slope=slope: jacobian(slope, self.derivative, self.y)
        return [
            Rival(name=name, runs={"state": repeated(way)}, values=lambda _, way=way: way(), language="Python")
            for name, way in ways.items()
        ]

    def exact(self) -> np.ndarray:
        """By differences over 1e-15 with 50 digits, good to 1e-28, rounded."""
        programs = dynamics_in_c(self.kernels, self.partitions, "emitted", self.q, self.kernels.p0).written.programs
        with mpmath.workdps(DIGITS):
            h = mpmath.mpf(10) ** -15
            y = [mpmath.mpf(float(x)) for x in self.y]
            columns = []
            for j in range(len(y)):
                sides = [_rates(programs, self.q, self.kernels.p0, [x + s * h * (i == j) for i, x in enumerate(y)]) for s in (1, -1)]
                columns.append([float((a - b) / (2 * h)) for a, b in zip(*sides, strict=True)])
        return np.array(columns).T


def _rates(programs: DynamicsPrograms, start: np.ndarray, p: np.ndarray, y: list[Any]) -> list[Any]:
    """ẏ in the numbers of y, which are mpmath's, the position problem solved to their digits."""
    split, count = programs.split, len(y) // 2
    q = [mpmath.mpf(float(x)) for x in start]
    for place, value in zip(split.independent, y[count:], strict=True):
        q[place] = value
    found = exact_motion(programs, q, y[:count], p)
    return found[len(q) : len(q) + count] + [found[place] for place in split.independent]
