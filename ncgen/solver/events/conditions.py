"""The conditions of a mechanism's events: their functions, and how each is found within a step."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.conditions import LINEAR, OFF, QUADRATIC, Conditions
from ncgen.mechanism.functions import CompiledFunctions, functions
from ncgen.mechanism.kernels import Kernels
from ncgen.model.actions import Change
from ncgen.model.elements import rate_name
from ncgen.model.events import Event
from ncgen.model.values import Scalar
from ncgen.program.motions.conditions import INPUTS, assemble_conditions, degree_of
from ncgen.solver.runs.stop import DIRECTIONS, Stop
from ncgen.solver.trajectories.happening import Search

NOISE = {LINEAR: 1000 * float(np.finfo(float).eps), QUADRATIC: 20000 * float(np.finfo(float).eps)}
"""Values below this times the sizes of their terms have no sign, as in ncgen_inside.c."""


@dataclass(frozen=True, eq=False)
class State:
    """An instant of a run: t (s), q and qd (n,) in m, rad and per second, p (n_p,) without what drives inputs."""

    t: float
    q: np.ndarray
    qd: np.ndarray
    p: np.ndarray


class EventFunctions:
    """The functions of a model's events; C is their number.

    kernels: those that the run is computed with
    """

    def __init__(self, kernels: Kernels) -> None:
        self.kernels, self.events = kernels, tuple(kernels.model.events.values())
        self.directions = np.array([DIRECTIONS[event.direction] for event in self.events], dtype=int)
        self._functions = kernels.remember("event functions", (), self._made)

    @cached_property
    def searches(self) -> tuple[Search, ...]:
        """How every condition is found."""
        return tuple("sampled" if self._degree(event) is None else "proof" for event in self.events)

    @cached_property
    def degree(self) -> int:
        """Of the polynomials in time that conditions are within a step."""
        return QUADRATIC if any(self._degree(event) == 2 for event in self.events) else LINEAR

    def watched(self, signs: np.ndarray, stop: Stop | None, off: np.ndarray) -> Conditions:
        """What C is given; signs (C,): sides on which conditions begin; stop: one more, the last; off (C,): mask of those that rest."""
        count = len(self.events)
        coordinates, values = np.full(count, -1), np.zeros(count)
        directions = np.where(off, OFF, self.directions)
        if stop:
            coordinates, values = np.append(coordinates, stop.coordinate), np.append(values, stop.value)
            directions, signs = np.append(directions, stop.direction), np.append(signs, 0)
        address = self._functions.address("conditions")
        return Conditions(coordinates, values, directions, signs, address, self.degree)

    def values(self, at: State) -> tuple[np.ndarray, np.ndarray]:
        """The conditions' values, and the sizes of their terms, (C,) each."""
        found = self._call("conditions", at)
        return found[::2], found[1::2]

    def scales(self, at: State) -> np.ndarray:
        """What the conditions' values are compared with, (C,): the sizes of their terms, and what moving by natural sizes changes."""
        return self.values(at)[1] + np.abs(self.slopes(at)[0]) @ self.kernels.column_sizes

    def slopes(self, at: State) -> tuple[np.ndarray, np.ndarray]:
        """Gradients ∂/∂q (C, n) and ∂/∂t (C,)."""
        found = self._call("condition_slopes", at).reshape(len(self.events), -1)
        return found[:, : self.kernels.n], found[:, -1]

    def rates(self, at: State, qdd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivatives along the motion (C,), the second of conditions without velocities; qdd (n,): accelerations."""
        found = self._functions("condition_rates", at.t, at.q, at.qd, qdd, self.kernels.present(at.t, at.p))
        return found[: len(self.events)], found[len(self.events) :]

    def numbers(self, at: State) -> dict[int, dict[str, float]]:
        """{position of the event: {name: new value}} of what actions change."""
        names = [(k, name) for k, name, _ in _changes(self.events)]
        found = self._call("action_values", at) if names else ()
        told: dict[int, dict[str, float]] = {}
        for (k, name), value in zip(names, found, strict=True):
            told.setdefault(k, {})[name] = float(value)
        return told

    def _call(self, name: str, at: State) -> np.ndarray:
        return self._functions(name, at.t, at.q, at.qd, self.kernels.present(at.t, at.p))

    @cached_property
    def _moving(self) -> set[str]:
        names = set(self.kernels.coordinates) | set(self.kernels.inputs)
        return names | {rate_name(name) for name in self.kernels.coordinates}

    def _degree(self, event: Event) -> int | None:
        """1 or 2 where the condition is such a polynomial of what is one in time within a step; None for others."""
        from ncgen.model.expressions import is_symbolic, symbols_in

        if is_symbolic(event.when) and {s.name for s in symbols_in(event.when)} & set(self.kernels.inputs):
            return None  # it may change in any way
        found = degree_of(event.when, self._moving)
        return max(found, 1) if found is not None and found <= 2 else None

    def _made(self) -> CompiledFunctions:
        kernels = self.kernels
        conditions = [(f"event {event.name}", event.when) for event in self.events]
        values: list[tuple[str, Scalar]] = [(f"event {self.events[k].name}, {name}", value) for k, name, value in _changes(self.events)]
        count = len(conditions)
        sizes = {
            "conditions": 2 * count,
            "condition_slopes": count * (2 * kernels.n + 1),
            "condition_rates": 2 * count,
            "action_values": len(values),
        }
        sizes = {name: size for name, size in sizes.items() if size}
        counts = {"q": kernels.n, "qd": kernels.n, "qdd": kernels.n, "p": len(kernels.p0)}
        told = hashlib.sha256(repr([(where, str(e)) for where, e in (*conditions, *values)]).encode()).hexdigest()[:16]
        made = functions(
            kernels, f"events {told}", {name: INPUTS[name] for name in sizes}, sizes, counts,
            lambda: assemble_conditions(kernels.programs.equations, conditions, values),
        )  # fmt: skip
        if not isinstance(made, CompiledFunctions):
            raise ModelError(f"{kernels.name}: events need compiled kernels; compile the model with backend='c'")
        return made


def _changes(events: tuple[Event, ...]) -> list[tuple[int, str, Scalar]]:
    """(position of the event, name, new value) of all that actions change by expressions."""
    return [(k, *pair) for k, event in enumerate(events) for a in event.do if isinstance(a, Change) for pair in a.values.items()]
