"""Gradients of what is kept of a variant: through a motion of its own, in steps of equal length, as `ncgen.gradient` takes them.

The independent coordinates are the same for all variants, since a derivative by a parameter is one at the same start of these.
"""

from __future__ import annotations

import warnings
from functools import cached_property
from typing import Any

import numpy as np

from ncgen.errors import ModelError, NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.methods.table import INTEGRATORS
from ncgen.model.elements import coordinate_of
from ncgen.solver.derivatives.sensitivity import Motion, motion_of
from ncgen.solver.engines.acceleration_forms import has_emitted_recursion
from ncgen.solver.groups import StartArguments
from ncgen.solver.trajectories.output_values import output_slopes, outputs_of
from ncgen.studies import extremes
from ncgen.studies.definition import Study
from ncgen.studies.design import started
from ncgen.studies.kept import Histories, Kept

DEFAULT_INTEGRATOR = "rk4"
"""Whose steps gradients go through, unless an explicit integrator is named."""

MAX_END_DIFFERENCE = 1e-3
"""Difference of two ends of a motion, relative to the sizes of the coordinates, from which the gradient's steps are too few."""


class Slopes:
    """Gradients of the variants of a study. Raises ModelError where one is by a start that is not independent.

    independent: names of the coordinates that start independently, () where no variant can be started
    """

    def __init__(self, study: Study, kernels: Kernels, independent: tuple[str, ...]) -> None:
        self.study, self.kernels, self.independent = study, kernels, independent
        for column in study.gradients:
            name = coordinate_of(started(column.by) or "")
            if name and independent and name not in independent:
                names = ", ".join(independent)
                raise ModelError(f"keep, {column.word}: {name} is not independent at the start; {names} are, others are chosen by z")

    @cached_property
    def integrator(self) -> str:
        """Whose steps are differentiated."""
        named = self.study.simulation.get("integrator", DEFAULT_INTEGRATOR)
        entry = INTEGRATORS.get(named)
        usable = entry is not None and entry.tableau and has_emitted_recursion(self.kernels, Method.of("lagrange", named))
        return named if usable else DEFAULT_INTEGRATOR

    def __str__(self) -> str:
        return f"gradients by {self.study.steps} steps of {self.integrator}"

    def of(self, row: np.ndarray, end: np.ndarray) -> tuple[dict[str, float], str | None]:
        """{column: its gradient, NaN where there is none} of the variant with these numbers, and why not, or what is doubtful.

        end: where its motion ends otherwise (n,)
        """
        study, options = self.study, self.study.options(row)
        start: dict[str, Any] = {name: options[name] for name in StartArguments.__annotations__ if name in options}
        if self.independent:
            start["z"] = self.independent
        assert study.steps is not None
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of a start that was projected: the run has said so
                motion = motion_of(self.kernels, options["duration"], study.steps, self.integrator, **start)
                gradients = self._all(motion, start.get("q0"))
        except NcgenError as error:
            return {column.word: np.nan for column in study.gradients}, f"no gradient: {error}"
        off = float(np.max(np.abs(motion.q[-1] - end) / self.kernels.column_sizes, initial=0.0))
        return (
            gradients,
            f"gradient: its {study.steps} steps end {off:.1g} away from the motion; take more steps" if off > MAX_END_DIFFERENCE else None,
        )

    def _all(self, motion: Motion, q0: Any) -> dict[str, float]:
        derivatives: dict[tuple[str, str], dict[str, float]] = {}
        gradients = {}
        for column in self.study.gradients:
            key = column.over, column.name
            if key not in derivatives:
                derivatives[key] = self._slopes(motion, column, q0)
            gradients[column.word] = derivatives[key].get(started(column.by) or column.by, np.nan)
        return gradients

    def _slopes(self, motion: Motion, column: Kept, q0: Any) -> dict[str, float]:
        """Derivatives of a number by everything: parameters, and positions and velocities of the independent coordinates at the start."""
        by_q, by_qd, by_p = self._weights(motion, column)
        by = [started(each.by) or each.by for each in self.study.gradients]
        derivatives = dict(zip(motion.names, motion.backward(by_q, by_qd, by)[0].tolist(), strict=True))
        free = [name for name in motion.names if name in self.kernels.index and isinstance(q0, dict) and name not in q0]
        rows = self.kernels.start_p(motion.p)[[self.kernels.index[name] for name in free]] if free else np.empty((0, len(motion.p)))
        for k, name in enumerate(self.kernels.parameters):  # a start that is given in part follows parameters in the rest
            derivatives[name] += by_p[k] + sum(rows[i, k] * derivatives[other] for i, other in enumerate(free))
        return derivatives

    def _weights(self, motion: Motion, column: Kept) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How what is kept changes with q and q̇ at all instants (K, n) and directly with p (n_p,)."""
        kernels, outputs = self.kernels, tuple(self.kernels.model.outputs)
        by_q, by_qd, by_p = np.zeros_like(motion.q), np.zeros_like(motion.q), np.zeros(len(motion.p))
        by_x, by_rates = np.zeros(len(motion.t)), np.zeros(len(motion.t))
        if column.over == "end":
            by_x[-1] = 1.0
        else:
            x, rates = self._history(motion, column.name)
            by_x, by_rates = extremes.weights(motion.t, x, rates, column.over == "max")
        if column.name in outputs:
            k, n = int(np.argmax(by_x)), kernels.n
            seeds = np.delete(np.eye(3 * n + kernels.m + len(motion.p)), np.s_[2 * n : 3 * n + kernels.m], axis=0)
            state = motion.q[k], motion.qd[k], np.zeros(n), np.zeros(kernels.m)
            derivative = output_slopes(kernels, float(motion.t[k]), state, motion.p, seeds)[outputs.index(column.name)]
            by_q[k], by_qd[k], by_p[:] = derivative[:n], derivative[n : 2 * n], derivative[2 * n :]
            return by_q, by_qd, by_p
        column_index = kernels.index[coordinate_of(column.name)]
        (by_q if column.name in kernels.index else by_qd)[:, column_index] = by_x
        by_qd[:, column_index] += by_rates
        return by_q, by_qd, by_p

    def _history(self, motion: Motion, name: str) -> tuple[np.ndarray, np.ndarray | None]:
        """What is looked at over the instants (K,), and its rates where they are known."""
        outputs, values = tuple(self.kernels.model.outputs), np.zeros((len(motion.t), 0))
        if name in outputs:
            values = outputs_of(self.kernels, motion.t, motion.q, motion.qd, motion.p)
        histories = Histories(
            index=self.kernels.index, labels=outputs, t=motion.t, q=motion.q[None], qd=motion.qd[None], outputs=values[None]
        )
        rates = histories.rates(name)
        return histories.of(name)[0], None if rates is None else rates[0]
