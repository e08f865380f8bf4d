"""Accelerations and projections of the C runtime for an integrator in Python, such as SciPy's."""

from __future__ import annotations

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.moving import Moving, Stepping
from ncgen.methods.method import Method, settings_in_c
from ncgen.solver.engines import acceleration_forms, capabilities
from ncgen.solver.runs.choice import EXPLICIT
from ncgen.solver.runs.task import Task

STEP_TOLERANCE = 1e-6
"""Tolerance of steps, which are not taken here."""


class MotionInC:
    """The state derivative of a formalism over all coordinates, and states on the constraints; None where C has none, and why is found in
    Python.

    method: its formalism and options count; rank: of Φ_q
    """

    def __init__(self, kernels: Kernels, method: Method, rank: int) -> None:
        self._kernels, n, formalism = kernels, kernels.n, method.formalism.name
        explicit = Method.of(formalism, EXPLICIT, method.options)
        self._dynamics = acceleration_forms.all_coordinates(kernels, form=acceleration_forms.form_of(kernels, explicit))
        stepping = Stepping(
            self._dynamics, EXPLICIT, rank, STEP_TOLERANCE, STEP_TOLERANCE, None, capabilities.closeness("double"), None, formalism,
            **settings_in_c(method.options),
        )  # fmt: skip
        self._now, self._qd, self._q = Moving(stepping), slice(0, n), slice(n, 2 * n)

    @classmethod
    def of(cls, kernels: Kernels, task: Task, rank: int) -> MotionInC | None:
        """None for a run of the reference in Python, and where C refuses the mechanism."""
        if not task.calls_c or capabilities.refusal(kernels, Method.of(task.method.formalism, EXPLICIT), "c", "double"):
            return None
        return cls(kernels, task.method, rank)

    def derivative(self, t: float, y: np.ndarray, p: np.ndarray) -> np.ndarray | None:
        """[q̈; q̇; power] (2 n + 1,) of a state y = [q̇; q; work] at t (s)."""
        if not self._asks(t, y, p, projecting=False):
            return None
        return np.concatenate([self._now.qdd, y[self._qd], [self._now.power]])

    def closed(self, t: float, y: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, float] | None:
        """The nearest state on the constraints, and how far q has moved, relative to its natural sizes."""
        if not self._asks(t, y, p, projecting=True):
            return None
        moved = float(np.max(np.abs(self._now.q - y[self._q]) / self._kernels.column_sizes, initial=0.0))
        return np.concatenate([self._now.qd, self._now.q, y[-1:]]), moved

    def _asks(self, t: float, y: np.ndarray, p: np.ndarray, projecting: bool) -> bool:
        """Whether C has an answer. Raises what a function of Python raises there."""
        now, called = self._now, self._dynamics.called
        now.t, now.q[:], now.qd[:], now.p[:] = t, y[self._q], y[self._qd], self._kernels.present(t, p)
        for each in called:
            each.begin()
        status = now.project_state() if projecting else now.evaluate()
        for each in called:
            if each.raised is not None:
                raise each.raised
        return status == "ok"
