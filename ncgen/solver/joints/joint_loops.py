"""The joint space of a mechanism with loops, over its independent rates.

Which rates are independent is chosen where it starts: coordinates that the model's author asked for (`m.independent`) first, then those
of joints. Near positions where they do not determine the others, the numbers grow beyond bounds: ask for other ones.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from ncgen.errors import ConvergenceError, ModelError, NcgenError
from ncgen.mechanism import recall
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.program_functions import ProgramFunctions
from ncgen.mechanism.shared_docstrings import shares
from ncgen.program.algebra.elimination import EliminationError
from ncgen.program.ir.blocks import Program
from ncgen.program.tree.joint_programs import Made
from ncgen.program.tree.loop_programs import JointLoops
from ncgen.program.tree.rates import NoRecursion
from ncgen.solver.engines.partition_dynamics import samples
from ncgen.solver.joints.joint_names import names_of
from ncgen.solver.joints.joint_positions import INPUTS
from ncgen.solver.joints.joint_space import JointSpace
from ncgen.solver.positions.assembly import assemble
from ncgen.symbolic.tree import Tree

MAX_STEP = 0.2
"""How far an independent joint goes before loops are closed again, in its natural size (a rad, or the mechanism's length)."""

MIN_STEP_FRACTION = 1e-4
"""Share of the first step to which steps are cut where loops do not close; they do not close where it would have to be shorter."""

MAX_DISPLACEMENT = 5000.0
"""How far an independent joint may be from its start, in its natural size: 796 turns, a few seconds of closing loops on the way."""

STEPS = 12
"""Of Newton's method at one place."""

STEP_ROUNDING = 1e-14
"""A step that is shorter, in natural sizes, is rounding."""

STALLED_STEP = 1e-9
"""A step that does not get shorter any more is rounding, too, if it is shorter than this."""


MAX_CACHED_STARTS = 16
"""Parameters for which the start with loops closed is kept."""


@shares()
class JointsInLoops(JointSpace):
    """Joints that hold each other. why: that they are no open tree, for messages."""

    kind = "joint_loops"
    inputs = INPUTS | {"joint_spread": ("t", "q", "p")}

    def __init__(self, kernels: Kernels, tree: Tree, why: ModelError) -> None:
        self.kernels, self.tree, self.why = kernels, tree, str(why)[:200]
        try:
            layout: dict[str, Any] = self._layout()
        except (NoRecursion, EliminationError, NcgenError) as error:
            raise ModelError(f"{self.why}, and of loops: {error}") from None
        self.free = np.array(layout["free"], dtype=int)
        self.sizes = np.array(layout["sizes"])
        self._coordinates: dict[int, int] = {c: k for c, k in layout["own"]}
        names = [*names_of(kernels, tree, {}), *(kernels.coordinates[c] for c in self._coordinates)]
        super().__init__(kernels, tree, tuple(names[k] for k in self.free))
        if not self.n:
            raise ModelError(f"{kernels.name}: every joint is locked by loops or drivers; joint space is undefined")

    def placed(self, x: np.ndarray) -> np.ndarray:
        x = self._checked(x, self.n, "x", "rates")
        positions = [self.closed(one)[1] for one in x.reshape(-1, self.n)]
        return np.array(positions).reshape(*x.shape[:-1], self.kernels.n)

    def closed(self, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute displacements and position at values of the independent joints.

        The loops are closed by way of positions between.

        Parameters
        ----------
        wanted : numpy.ndarray
            Values of the independent joints (m, rad).

        Returns
        -------
        tuple of numpy.ndarray
            Displacements and position as of `begin`.
        """
        x, q = self.begin
        start = x[self.free].copy()
        way = (wanted - start) / self.sizes[self.free]
        far = float(np.max(np.abs(way), initial=0.0))
        if not far <= MAX_DISPLACEMENT:
            k = int(np.argmax(np.abs(way)))
            raise ConvergenceError(
                f"{self.kernels.name}: {self.rates[k]} = {wanted[k]:.6g} is {abs(way[k]):.3g} natural sizes from the start; loops are "
                f"followed for {MAX_DISPLACEMENT:g} at most; leave out whole turns"
            )
        step = first = min(1.0, MAX_STEP / max(far, 1e-300))
        done = 0.0
        while done < 1.0:
            fraction = min(1.0, done + step)
            ahead = x.copy()
            ahead[self.free] = wanted if fraction == 1.0 else start + fraction * (wanted - start)
            if (newton := self._newton(ahead)) is not None:
                (x, q), done = newton, fraction
            elif step < MIN_STEP_FRACTION * first:
                values = ", ".join(f"{name} = {value:.6g}" for name, value in zip(self.rates, ahead[self.free], strict=True))
                raise ConvergenceError(f"{self.kernels.name}: loops do not close where {values[:200]}; choose other values")
            else:
                step /= 2
        return x, q

    @property
    def begin(self) -> tuple[np.ndarray, np.ndarray]:
        """All displacements of joints, and coordinates of no body, at the start with loops closed, and the position there."""
        return self.kernels.remember("start of joints in loops", self.p.tobytes(), self._begin, MAX_CACHED_STARTS)

    def _begin(self) -> tuple[np.ndarray, np.ndarray]:
        x, start = np.zeros(len(self.sizes)), self.kernels.start(self.p)
        for c, k in self._coordinates.items():
            x[k] = start[c]
        newton = self._newton(x)
        if newton is None:
            raise ConvergenceError(f"{self.kernels.name}: loops do not close at the start; run assemble first and correct the model")
        return newton

    def _newton(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Displacements and position with loops closed, near to where they are; None where there is no such place."""
        last = np.inf
        for _ in range(STEPS):
            outputs = self._functions("joint_position", 0.0, x, self.p)
            q, change = outputs[: self.kernels.n], outputs[self.kernels.n :]
            size = float(np.max(np.abs(change) / self.sizes, initial=0.0))
            if not size <= 1.0:
                return None
            x = x + change
            if size <= STEP_ROUNDING or (size <= STALLED_STEP and size >= last / 2):
                return x, q
            last = size
        return None

    def _spread(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        outputs, count = self._of("joint_spread", q), len(self.sizes)
        return outputs[..., :-count].reshape(*outputs.shape[:-1], count, self.n), outputs[..., -count:]

    def _spread_rate(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        outputs = self._spread_functions("joint_spread_rate", 0.0, q, v, self.p)
        return outputs.reshape(*outputs.shape[:-1], len(self.sizes), self.n)

    @cached_property
    def _spread_functions(self) -> ProgramFunctions:
        return self._functions_of(
            "spread", {"joint_spread_rate": ("t", "q", "v", "p")}, lambda: {"joint_spread_rate": len(self.sizes) * self.n}
        )

    def _momenta(self, q: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        mass, first, matrix = super()._momenta(q)
        none = np.zeros((*matrix.shape[:-2], len(self._coordinates), 6))  # of coordinates of no body
        return mass, first, np.concatenate([matrix, none], axis=-2)

    def _own(self) -> Mapping[int, int]:
        return self._coordinates

    # -- programs ------------------------------------------------------------------------------

    def _layout(self) -> dict[str, Any]:
        """Which rates are free, and what belongs to them, without assembling anything where it is known."""

        def layout_text() -> dict[str, str]:
            rates = self._work.rates
            return {"layout": json.dumps({"free": list(rates.free), "own": list(rates.own.items()), "sizes": rates.sizes.tolist()})}

        return json.loads(recall.derived(self.kernels.programs, "layout of joints in loops", layout_text)["layout"])

    def made(self, group: Made) -> dict[str, Program]:
        return self._work.programs(group)

    @cached_property
    def _work(self) -> JointLoops:
        kernels = self.kernels
        q = assemble(kernels, kernels.q0)
        wanted = [kernels.index[name] for name in kernels.model.chosen_independent]
        return JointLoops(kernels.programs.equations, samples(kernels, q, kernels.p0), kernels.column_sizes, wanted)

    def _counts(self) -> dict[str, int]:
        return super()._counts() | {"x": len(self.sizes)}

    def _sizes(self) -> dict[str, int]:
        rates = len(self.sizes)
        return super()._sizes() | {"joint_position": self.kernels.n + rates, "joint_spread": rates * (self.n + 1)}
