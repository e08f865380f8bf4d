"""Jacobians of the functions of a mechanism's events by t, q, q̇ and p, column by column, compiled when they are first asked for."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.program_functions import ProgramFunctions
from ncgen.mechanism.program_functions import functions as functions_of
from ncgen.program.ir.blocks import Program
from ncgen.program.motions.event_tangents import INPUTS, assemble_action_tangents, assemble_condition_tangent
from ncgen.solver.events.conditions import EventFunctions
from ncgen.solver.events.modes import Held, count_of, held_loads
from ncgen.solver.events.state import State
from ncgen.solver.loads.constraint_loads import motion_sizes


class EventTangents:
    """Those of a mechanism, N = 1 + 2 n + n_p columns each."""

    def __init__(self, functions: EventFunctions) -> None:
        self.functions, self.kernels = functions, functions.kernels
        kernels = self.kernels
        self._seeds = np.eye(1 + 2 * kernels.n + len(kernels.p0))
        self.gaps = [k for k, event in enumerate(functions.events) if event.impact]

    def conditions(self, mode: Kernels, held: tuple[Held, ...], at: State) -> np.ndarray:
        """Of the conditions of a mode, those of loads behind those of the mechanism, (C + L, N)."""
        return self._columns(mode.remember("condition tangent", (), lambda: self._conditions(mode, held)), "condition_tangent", at)

    def values(self, at: State) -> np.ndarray:
        """Of the values of actions and elements, in the order of `EventFunctions.named_values`, (V, N)."""
        return self._columns(self._actions, "value_tangent", at) if self.functions.named_values else np.zeros((0, len(self._seeds)))

    def impact(self, at: State, after: np.ndarray, mu: np.ndarray, push: Mapping[int, float]) -> tuple[np.ndarray, ...]:
        """Of M (q̇⁺ − q̇) + Φ_qᵀ μ − Wᵀ Λ (n, N), of Φ_q q̇⁺ − ν (m, N) and of all gaps' velocities before and after, (gaps, N) each.

        after (n,): q̇⁺; mu (m,): impulses of the constraints; push: {number of an event: impulse of its gap}
        """
        impulses = np.array([push.get(k, 0.0) for k in self.gaps])
        columns = self._columns(self._actions, "impact_tangent", at, after, mu, impulses)
        n, m = self.kernels.n, self.kernels.m
        return columns[:n], columns[n : n + m], columns[n + m :: 2], columns[n + m + 1 :: 2]

    def _columns(self, made: ProgramFunctions, name: str, at: State, *more: np.ndarray) -> np.ndarray:
        p = self.kernels.present(at.t, at.p)
        return np.array([made(name, at.t, at.q, at.qd, p, *more, seed) for seed in self._seeds]).T

    @property
    def _counts(self) -> dict[str, int]:
        n, m = self.kernels.n, self.kernels.m
        return {"q": n, "qd": n, "p": len(self.kernels.p0), "after": n, "mu": m, "push": len(self.gaps), "seed": len(self._seeds)}

    def _conditions(self, mode: Kernels, held: tuple[Held, ...]) -> ProgramFunctions:
        conditions, loads = self.functions.conditions, held_loads(mode, held)

        def made() -> dict[str, Program]:
            return assemble_condition_tangent(mode.programs.equations, conditions, loads, motion_sizes(mode), mode.row_sizes)

        sizes = {"condition_tangent": len(conditions) + count_of(held)}
        return functions_of(
            mode,
            _word("conditions", [*conditions, *((each.words, each.static) for each in loads)]),
            {name: INPUTS[name] for name in sizes},
            sizes,
            self._counts,
            made,
        )

    @property
    def _actions(self) -> ProgramFunctions:
        return self.kernels.remember("action tangents", (), self._made)

    def _made(self) -> ProgramFunctions:
        kernels, values, conditions = self.kernels, self.functions.named_values, self.functions.conditions
        gaps = [conditions[k] for k in self.gaps]
        sizes = {"value_tangent": len(values)} if values else {}
        sizes["impact_tangent"] = kernels.n + kernels.m + 2 * len(gaps)
        return functions_of(
            kernels, _word("actions", [*values, *gaps]), {name: INPUTS[name] for name in sizes}, sizes, self._counts,
            lambda: assemble_action_tangents(kernels.programs.equations, values, gaps),
        )  # fmt: skip


def _word(what: str, expressions: list) -> str:
    """A word for functions of these (words, expression)."""
    return f"tangents_of_{what}_{hashlib.sha256(repr([(where, str(e)) for where, e in expressions]).encode()).hexdigest()[:16]}"
