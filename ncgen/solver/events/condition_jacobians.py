"""Jacobians of the functions of a mechanism's events by t, q, q̇ and p, column by column, compiled when they are first asked for."""

from __future__ import annotations

import hashlib

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.program_functions import ProgramFunctions
from ncgen.mechanism.program_functions import functions as functions_of
from ncgen.program.ir.blocks import Program
from ncgen.program.motions.event_tangents import INPUTS, assemble_condition_tangent, assemble_impact_tangent, assemble_value_tangents
from ncgen.solver.events.conditions import EventFunctions
from ncgen.solver.events.holdables import Holdable
from ncgen.solver.events.modes import count_of, held_loads, sliding_of
from ncgen.solver.events.state import State
from ncgen.solver.loads.constraint_loads import motion_sizes


class EventTangents:
    """Those of a mechanism, N = 1 + 2 n + n_p columns each."""

    def __init__(self, functions: EventFunctions) -> None:
        self.functions, self.kernels = functions, functions.kernels
        kernels = self.kernels
        self._seeds = np.eye(1 + 2 * kernels.n + len(kernels.p0))
        self._gaps = [(k, functions.conditions[k]) for k, event in enumerate(functions.events) if event.impact]
        slides = ((gap, functions.contacts[k].sliding) for k, gap in functions.gaps.items())
        self._rates = [(k, (f"contact {functions.events[k].name}", w)) for k, sliding in slides for w in sliding]
        self._rates += [(k, functions.conditions[k]) for k in functions.ratchets]

    @property
    def row_count(self) -> int:
        """Rows of W of all gaps and ratchets."""
        return len(self._gaps) + len(self._rates)

    def places(self, k: int) -> list[int]:
        """Of a gap or ratchet, by the number of its condition, the rows of W: its own, then those at which it slides."""
        return [row for row, (number, _) in enumerate((*self._gaps, *self._rates)) if number == k]

    def conditions(self, mode: Kernels, held: tuple[Holdable, ...], at: State) -> np.ndarray:
        """Of the conditions of a mode, those of loads behind those of the mechanism, (C + L, N)."""
        return self._columns(mode.remember("condition tangent", (), lambda: self._conditions(mode, held)), "condition_tangent", at)

    def values(self, at: State) -> np.ndarray:
        """Of the values of actions and elements, in the order of `EventFunctions.named_values`, (V, N)."""
        return self._columns(self._values, "value_tangent", at) if self.functions.named_values else np.zeros((0, len(self._seeds)))

    def impact(self, mode: Kernels, at: State, after: np.ndarray, mu: np.ndarray, push: np.ndarray | None = None) -> tuple[np.ndarray, ...]:
        """Of M (q̇⁺ − q̇) + Φ_qᵀ μ − Wᵀ Λ (n, N), of Φ_q q̇⁺ − ν (m, N) and of the velocities of the rows of W before and after, (r, N) each.

        mode: whose constraints have the impulses mu (m,); after (n,): q̇⁺; push (r,): Λ, None for 0
        """
        made = mode.remember("impact tangent", (), lambda: self._impact(mode))
        columns = self._columns(made, "impact_tangent", at, after, mu, np.zeros(self.row_count) if push is None else push)
        n, m = self.kernels.n, mode.m
        return columns[:n], columns[n : n + m], columns[n + m :: 2], columns[n + m + 1 :: 2]

    def _columns(self, made: ProgramFunctions, name: str, at: State, *more: np.ndarray) -> np.ndarray:
        p = self.kernels.present(at.t, at.p)
        return np.array([made(name, at.t, at.q, at.qd, p, *more, seed) for seed in self._seeds]).T

    def _counts(self, mode: Kernels) -> dict[str, int]:
        n = self.kernels.n
        return {"q": n, "qd": n, "p": len(self.kernels.p0), "after": n, "mu": mode.m, "push": self.row_count, "seed": len(self._seeds)}

    def _conditions(self, mode: Kernels, held: tuple[Holdable, ...]) -> ProgramFunctions:
        conditions, loads = self.functions.conditions, held_loads(mode, held)
        sliding = sliding_of(mode, held, self.functions.loaded)

        def made() -> dict[str, Program]:
            return assemble_condition_tangent(mode.programs.equations, conditions, loads, sliding, motion_sizes(mode), mode.row_sizes)

        words = [*conditions, *((e.words, (e.row, e.static, e.grip, e.directions, e.pressed)) for e in loads)]
        words += [(s.words, (s.row, s.velocity, s.friction, s.slip)) for s in sliding]
        sizes = {"condition_tangent": len(conditions) + count_of(held)}
        return functions_of(
            mode,
            _word("conditions", words),
            {name: INPUTS[name] for name in sizes},
            sizes,
            self._counts(mode),
            made,
        )

    def _impact(self, mode: Kernels) -> ProgramFunctions:
        gaps, rates = ([named for _, named in pairs] for pairs in (self._gaps, self._rates))
        size = mode.n + mode.m + 2 * self.row_count
        return functions_of(
            mode, _word("impacts", [*gaps, *rates]), {"impact_tangent": INPUTS["impact_tangent"]}, {"impact_tangent": size},
            self._counts(mode), lambda: assemble_impact_tangent(mode.programs.equations, gaps, rates),
        )  # fmt: skip

    @property
    def _values(self) -> ProgramFunctions:
        return self.kernels.remember("value tangents", (), self._made)

    def _made(self) -> ProgramFunctions:
        kernels, values = self.kernels, self.functions.named_values
        return functions_of(
            kernels, _word("values", values), {"value_tangent": INPUTS["value_tangent"]}, {"value_tangent": len(values)},
            self._counts(kernels), lambda: assemble_value_tangents(kernels.programs.equations, values),
        )  # fmt: skip


def _word(kind: str, expressions: list) -> str:
    """A word for functions of these (words, expression)."""
    return f"tangents_of_{kind}_{hashlib.sha256(repr([(where, str(e)) for where, e in expressions]).encode()).hexdigest()[:16]}"
