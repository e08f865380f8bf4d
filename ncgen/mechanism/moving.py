"""A mechanism that moves from call to call of the C runtime (`ncgen_driven.h`): nothing is analysed or allocated in between."""

from __future__ import annotations

import numpy as np

from ncgen.mechanism.library import STATUS
from ncgen.mechanism.runtime import ConstrainedDynamics
from ncgen.methods.table import FORMALISMS, INTEGRATORS, number_in_c

ANY_STEP = 1e30
"""s; a longest step that is none."""


class Moving:
    """Where a mechanism is, in memory that C works on.

    q, qd, qdd (n,): position, velocities and accelerations (m, rad, and per second); p (n_p,): parameters and inputs; all but qdd may be
        written to
    t: s; work: J; evaluations: of the last call of `go_on`
    """

    def __init__(
        self, dynamics: ConstrainedDynamics, method: str, rank: int, rtol: float, atol: float, sizes: np.ndarray | None, tolerance: float
    ) -> None:
        """method: an explicit one of `ncgen.methods.table`; rank: of Φ_q; sizes (2 n + 1,): what atol is multiplied by; tolerance: of
        the position problem."""
        kernels, self._dynamics = dynamics.kernels, dynamics  # which keeps its library
        ffi, library = dynamics.interface
        self._real = dynamics.number.array
        self._sizes = None if sizes is None else np.ascontiguousarray(sizes, dtype=dynamics.number.dtype)
        self._options = ffi.new("ncgen_options *", {
            "method": number_in_c(INTEGRATORS[method]), "formalism": number_in_c(FORMALISMS["lagrange"]), "project": 1,
            "rtol": rtol, "atol": atol, "tolerance": tolerance, "max_step": ANY_STEP,
        })  # fmt: skip
        if self._sizes is not None:
            self._options.sizes = ffi.from_buffer(self._real, self._sizes)
        model, described = dynamics.described(rank)
        self._described = described  # lives as long
        self._driven = ffi.new("ncgen_driven *", {"model": model, "dynamics": described, "options": self._options})
        self._workspace = np.empty(library.ncgen_driven_workspace(self._driven), dynamics.number.dtype)
        self._integers = np.empty(4 * kernels.n + 3 * kernels.m, np.intc)
        self._driven.workspace = ffi.from_buffer(self._real, self._workspace)
        self._driven.integers = ffi.from_buffer("int[]", self._integers)
        n, dtype = kernels.n, dynamics.number.dtype
        self.q, self.qd, self.qdd, self.p = (np.zeros(size, dtype) for size in (n, n, n, len(kernels.p0)))
        self._moment = ffi.new("ncgen_moment *", {name: ffi.from_buffer(self._real, getattr(self, name)) for name in ("q", "qd", "qdd")})
        self._p = ffi.from_buffer(self._real, self.p)
        self._statistics, self._ffi, self._library = ffi.new("ncgen_statistics *"), ffi, library
        self._go_on = library.ncgen_go_on

    @property
    def t(self) -> float:
        return self._moment.t

    @t.setter
    def t(self, value: float) -> None:
        self._moment.t = value

    @property
    def work(self) -> float:
        return self._moment.work

    @work.setter
    def work(self, value: float) -> None:
        self._moment.work = value

    @property
    def next_step(self) -> float:
        """s; what error control tries next, 0 where it has to find one."""
        return self._moment.h

    @next_step.setter
    def next_step(self, value: float) -> None:
        self._moment.h = value

    @property
    def workspace(self) -> int:
        """Numbers that C works in."""
        return len(self._workspace)

    @property
    def evaluations(self) -> int:
        return self._statistics.evaluations

    def go_on(self, h: float) -> str:
        """On by h seconds: "ok", or why not; then nothing has moved."""
        return STATUS[self._go_on(self._driven, self._p, self._moment, self._moment.t + h, self._statistics)]

    def settle(self) -> str:
        """Position and velocities onto the constraints: "ok", or why not; then nothing has moved."""
        return STATUS[self._library.ncgen_settle_moment(self._driven, self._p, self._moment)]

    def evaluate(self) -> str:
        """Accelerations with the present p into qdd: "ok", or why there are none."""
        return STATUS[self._library.ncgen_evaluate_moment(self._driven, self._p, self._moment)]
