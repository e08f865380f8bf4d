"""The conditions of a mechanism's events: their functions, and how each is found within a step."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.conditions_in_c import LINEAR, QUADRATIC, UNWATCHED, Conditions, Formulas
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.program_functions import CompiledFunctions, functions
from ncgen.model import Model
from ncgen.model.actions import Change
from ncgen.model.contacts import Contact
from ncgen.model.elements import rate_name
from ncgen.model.events import Event, Lock
from ncgen.model.frictions import Friction
from ncgen.model.one_sided import Ratchet
from ncgen.model.values import Scalar, Value, as_sympy, is_number
from ncgen.program.motions.condition_formulas import FormulaTable, assemble_formulas
from ncgen.program.motions.event_programs import INPUTS, assemble_conditions, degree_of
from ncgen.solver.events.holdables import LOCK, Holdable, holdables
from ncgen.solver.events.modes import LoadConditions, variant
from ncgen.solver.events.state import State
from ncgen.solver.runs.stop import DIRECTIONS, StopCondition
from ncgen.solver.trajectories.happening import Search
from ncgen.toolchain.abi import InC

VALUE_ROUNDING = {LINEAR: 1000 * float(np.finfo(float).eps), QUADRATIC: 20000 * float(np.finfo(float).eps)}
"""Values below this times the sizes of their terms have no sign, as in ncgen_inside.c."""


class EventFunctions:
    """The functions of a model's events; C is their number.

    kernels: those that the run is computed with; frictions, contacts: {number of a condition: whose velocity it is}; gaps: {number of a
    contact's: that of its gap}; turns: {number: contact in space whose direction it watches}
    """

    def __init__(self, kernels: Kernels) -> None:
        model = kernels.model
        self.kernels, self.events, self.named = kernels, tuple(model.events.values()), model.events
        self.frictions: dict[int, Friction] = dict(enumerate(model.frictions.values(), len(self.events)))
        rubbing = enumerate(model.contacts.values(), len(self.events) + len(self.frictions))
        self.contacts: dict[int, Contact] = dict(rubbing)
        names = [event.name for event in self.events]
        self.gaps = {k: names.index(contact.name) for k, contact in self.contacts.items()}
        first = len(self.events) + len(self.frictions) + len(self.contacts)
        self.ratchets: dict[int, Ratchet] = dict(enumerate(model.ratchets.values(), first))
        self.locks = {each.name: each for each in holdables(model) if each.kind == LOCK}
        turning = [k for k, contact in self.contacts.items() if len(contact.sliding) > 1]
        self.turns = dict(enumerate(turning, first + len(self.ratchets)))
        self.count = first + len(self.ratchets) + len(self.turns)
        self.directions = np.array(directions_of(model), dtype=int)
        self._functions = kernels.remember("event functions", (), self._made)
        self._sampled = np.zeros(self.count, dtype=bool)
        self._last: dict[str, tuple[State, np.ndarray]] = {}  # what was asked last of every function: a state is asked again and again

    @property
    def searches(self) -> tuple[Search, ...]:
        """How every condition is found; one that had no bounds on some part of the run is sampled."""
        return tuple("sampled" if sampled else each for each, sampled in zip(self._expected, self._sampled, strict=True))

    @property
    def _expected(self) -> tuple[Search, ...]:
        return self.kernels.remember("searches of events", (), self._searches)

    @property
    def sampled(self) -> tuple[bool, ...]:
        """Of every condition: True where it is neither such a polynomial nor has bounds."""
        return tuple(each == "sampled" for each in self._expected)

    def _searches(self) -> tuple[Search, ...]:
        formulas = self._table.formulas
        return tuple("interval" if formulas[k] else "polynomial" if d else "sampled" for k, d in enumerate(self._degrees))

    @property
    def _degrees(self) -> list[int | None]:
        return self.kernels.remember(
            "degrees of conditions", (), lambda: [degree_within_step(when, self.kernels) for _, when in self.conditions]
        )

    @property
    def _table(self) -> FormulaTable:
        return self.kernels.remember("formulas of conditions", (), self._made_formulas)

    def _made_formulas(self) -> FormulaTable:
        pairs = zip(self.conditions, self._degrees, strict=True)
        bounded = [None if degree or mentions_inputs(each[1], self.kernels) else each for each, degree in pairs]
        return assemble_formulas(self.kernels.programs.equations, bounded)

    @property
    def unread(self) -> np.ndarray:
        """Mask (n_p,) of the parameters and inputs that no condition reads."""
        return self.kernels.remember("parameters that no condition reads", (), self._unread)

    def _unread(self) -> np.ndarray:
        from ncgen.model.expressions import is_symbolic, symbols_in

        read = {s.name for _, when in self.conditions if is_symbolic(when) for s in symbols_in(when)}
        return np.array([name not in read for name in self.kernels.parameters], dtype=bool)

    @cached_property
    def rows(self) -> tuple[Holdable, ...]:
        """The constraints that modes can have."""
        made = self.kernels.remember("rows of modes", (), lambda: tuple(holdables(self.kernels.model)))
        return tuple(each for each in made if each.kind != LOCK)

    @property
    def moving(self) -> dict[int, Friction | Ratchet]:
        """What is held by its velocity, by the numbers of its conditions."""
        return {**self.frictions, **self.ratchets}

    def mode(self, at: State, held: Sequence[Holdable] = ()) -> Kernels:
        """The kernels of the mode in which these are held and the locks of a state are closed; held constraints are the last ones."""
        return variant(self.kernels, (*(self.locks[name] for name in at.locked), *held))

    @property
    def loaded(self) -> tuple[Friction, ...]:
        """Frictions that follow the load of a constraint; with one of these every mode is a variant of the mechanism."""
        return tuple(each for each in self.frictions.values() if each.load is not None)

    @property
    def can_hold(self) -> bool:
        """True where the mechanism has modes."""
        return bool(self.rows or self.locks)

    @cached_property
    def degree(self) -> int:
        """Of the polynomials in time that conditions are within a step."""
        return most_degree(self.kernels)

    def watched(self, signs: np.ndarray, stop: StopCondition | None, directions: np.ndarray, loads: LoadConditions | None) -> Conditions:
        """What C is given.

        signs (C,): sides on which conditions begin; directions (C,); loads: those of what is held, behind them; stop: the last one
        """
        more = loads.count if loads else 0
        count = self.count + more
        coordinates, values = np.full(count, -1), np.zeros(count)
        directions, signs = np.append(directions, [-1] * more), np.append(signs, [1] * more)
        sampled = np.array([*self.sampled, *([True] * more), *([False] if stop else [])], dtype=bool)
        if stop:
            coordinates, values = np.append(coordinates, stop.coordinate), np.append(values, stop.value)
            directions, signs = np.append(directions, stop.direction), np.append(signs, 0)
        address = loads.address if loads else self._functions.address("conditions") if self.count else None
        formulas = Formulas(self._table, self._sampled) if any(self._table.formulas) else None
        return Conditions(
            coordinates=coordinates,
            values=values,
            directions=directions,
            signs=signs,
            sampled=sampled,
            function=address,
            degree=self.degree,
            formulas=formulas,
        )

    def values(self, at: State) -> tuple[np.ndarray, np.ndarray]:
        """The conditions' values, and the sizes of their terms, (C,) each."""
        pairs = self._call("conditions", at)
        return pairs[::2], pairs[1::2]

    def weighed(self, at: State) -> tuple[np.ndarray, np.ndarray]:
        """The conditions' values, and what they are compared with, (C,) each: sizes of terms, and what moving by natural sizes changes."""
        values, terms = self.values(at)
        return values, terms + np.abs(self.slopes(at)[0]) @ self.kernels.column_sizes

    def slopes(self, at: State) -> tuple[np.ndarray, np.ndarray]:
        """Gradients ∂/∂q (C, n) and ∂/∂t (C,)."""
        gradients = self._slopes(at)
        return gradients[:, : self.kernels.n], gradients[:, -1]

    def rate_slopes(self, at: State) -> np.ndarray:
        """Gradients ∂/∂q̇ (C, n)."""
        return self._slopes(at)[:, self.kernels.n : 2 * self.kernels.n]

    def _slopes(self, at: State) -> np.ndarray:
        return self._call("condition_derivatives", at).reshape(self.count, 2 * self.kernels.n + 1)

    def rates(self, at: State, qdd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivatives along the motion (C,), the second of conditions without velocities; qdd (n,): accelerations."""
        if not self.count:
            return np.empty(0), np.empty(0)
        derivatives = self._functions("condition_rates", at.t, at.q, at.qd, qdd, self.kernels.present(at.t, at.p))
        return derivatives[: self.count], derivatives[self.count :]

    def raw(self, name: str) -> InC:
        """The function in C itself."""
        return self._functions.raw(name)

    def address(self, name: str) -> int:
        """Where it is."""
        return self._functions.address(name)

    def numbers(self, at: State) -> dict[int, dict[str, float]]:
        """{position of the event: {name: new value}} of what actions change."""
        names = [(k, name) for k, name, _ in changes_of(self.events)]
        values_of_actions = self._call("action_values", at) if names else ()
        by_event: dict[int, dict[str, float]] = {}
        for (k, name), value in zip(names, values_of_actions, strict=True):
            by_event.setdefault(k, {})[name] = float(value)
        return by_event

    def _call(self, name: str, at: State) -> np.ndarray:
        if not self.count and name in ("conditions", "condition_derivatives"):
            return np.empty(0)
        last, numbers = self._last.get(name, (None, None))
        if last is not at or numbers is None:
            numbers = self._functions.at_state(name, at.t, (at.q, at.qd, self.kernels.present(at.t, at.p)))
            self._last[name] = at, numbers
        return numbers

    @cached_property
    def conditions(self) -> list[tuple[str, Scalar]]:
        """(words, expression) of every condition."""
        return conditions_of(self.kernels.model)

    @property
    def read_inputs(self) -> EventFunctions:
        """Those that read inputs where p has them."""
        return EventFunctions(self.kernels.driven_by(None))

    def restitution(self, k: int, at: State) -> float:
        """Of an event's impact; 0 for other events."""
        event = self.events[k]
        return self._number(f"event {event.name}", event.impact.restitution, at) if event.impact else 0.0

    def static(self, k: int, at: State) -> float:
        """Static friction of a friction (N or N m), or its coefficient where it follows a load."""
        return self._number(f"friction {self.frictions[k].name}", self.frictions[k].static, at)

    def friction(self, k: int, at: State) -> float:
        """Coefficient of friction of a contact."""
        return self._number(f"contact {self.contacts[k].name}, friction", self.contacts[k].friction, at)

    def tangential(self, k: int, at: State) -> float:
        """Tangential restitution of a contact."""
        return self._number(f"contact {self.contacts[k].name}, tangential", self.contacts[k].tangential, at)

    def sliding(self, at: State) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """{contact: (velocities (d,) at which it slides, m/s, and their gradients (d, n) by q̇)}, d being 1 in the plane and 2 in space."""
        if not self.contacts:
            return {}
        numbers = self._call("contact_velocities", at)
        sizes, n, velocities, start = [len(c.sliding) for c in self.contacts.values()], self.kernels.n, {}, 0
        slopes = numbers[sum(sizes) :].reshape(sum(sizes), n)
        for k, size in zip(self.contacts, sizes, strict=True):
            velocities[k] = numbers[start : start + size], slopes[start : start + size]
            start += size
        return velocities

    def place(self, of: Friction | Ratchet | Lock, at: State) -> float:
        """Where what is held is (m or rad)."""
        return self._element(f"{of.name}, place", at)

    def beginnings(self, at: State) -> dict[str, float]:
        """{name: number} of what parameters and inputs are at the start."""
        return {name: self._number(name, value, at) for name, value in self.kernels.model.beginnings.items()}

    def _number(self, where: str, value: Value | Scalar, at: State) -> float:
        """A number, or an expression."""
        return float(value) if is_number(value) else self._element(where, at)

    def _element(self, where: str, at: State) -> float:
        """The value of an element that is an expression, by its words."""
        indices = self.kernels.remember("places of elements", (), lambda: {words: k for k, (words, _) in enumerate(self._elements)})
        return float(self._call("element_values", at)[indices[where]])

    @cached_property
    def named_values(self) -> list[tuple[str, Scalar]]:
        """(words, value) of what actions change by expressions, in the order of `changes_of`, and then of elements."""
        return [*((f"event {self.events[k].name}, {name}", value) for k, name, value in changes_of(self.events)), *self._elements]

    @cached_property
    def _elements(self) -> list[tuple[str, Scalar]]:
        """(words, value) of restitutions, friction, places and beginnings that are expressions."""
        pairs = [(f"event {event.name}", event.impact.restitution) for event in self.events if event.impact]
        pairs += [(f"friction {each.name}", each.static) for each in self.frictions.values()]
        pairs += [(f"contact {each.name}, friction", each.friction) for each in self.contacts.values()]
        pairs += [(f"contact {each.name}, tangential", each.tangential) for each in self.contacts.values()]
        pairs += [(f"{each.name}, place", each.along.position) for each in (*self.moving.values(), *self.kernels.model.locks.values())]
        pairs += list(self.kernels.model.beginnings.items())
        return [(words, as_sympy(value)) for words, value in pairs if not is_number(value)]

    def _made(self) -> CompiledFunctions:
        kernels, conditions = self.kernels, self.conditions
        values: list[tuple[str, Scalar]] = [(f"event {self.events[k].name}, {name}", value) for k, name, value in changes_of(self.events)]
        slides = [(f"contact {each.name}", w) for each in self.contacts.values() for w in each.sliding]
        count = len(conditions)
        sizes = {
            "conditions": 2 * count,
            "condition_derivatives": count * (2 * kernels.n + 1),
            "condition_rates": 2 * count,
            "action_values": len(values),
            "element_values": len(self._elements),
            "contact_velocities": len(slides) * (kernels.n + 1),
        }
        sizes = {name: size for name, size in sizes.items() if size}
        counts = {"q": kernels.n, "qd": kernels.n, "qdd": kernels.n, "p": len(kernels.p0)}
        digest = hashlib.sha256(
            repr([(where, str(e)) for where, e in (*conditions, *values, *self._elements, *slides)]).encode()
        ).hexdigest()[:16]
        made = functions(
            kernels, f"events_{digest}", {name: INPUTS[name] for name in sizes}, sizes, counts,
            lambda: assemble_conditions(kernels.programs.equations, conditions, values, self._elements, slides),
        )  # fmt: skip
        if not isinstance(made, CompiledFunctions):
            raise ModelError(f"{kernels.name}: events need compiled kernels; compile the model with backend='c'")
        return made


def conditions_of(model: Model) -> list[tuple[str, Scalar]]:
    """(words, expression) of all conditions: of events, then of joints with friction, contacts, ratchets, and directions of sliding."""
    rates = [(f"friction {each.name}", each.along.rate) for each in model.frictions.values()]
    teeth = [(f"ratchet {each.name}", each.along.rate) for each in model.ratchets.values()]
    slides = [(f"contact {each.name}", each.forward) for each in model.contacts.values()]
    turns = [(f"contact {each.name}", each.kept) for each in model.contacts.values() if len(each.sliding) > 1]
    return [*((f"event {event.name}", event.when) for event in model.events.values()), *rates, *slides, *teeth, *turns]


def directions_of(model: Model) -> list[int]:
    """Of the same conditions: those of events, and that ratchets begin to turn back; what slides is watched as long as it does."""
    watched, falling = [DIRECTIONS[event.direction] for event in model.events.values()], [DIRECTIONS["falling"]] * len(model.ratchets)
    slides = [UNWATCHED] * (len(model.frictions) + len(model.contacts))
    return [*watched, *slides, *falling, *([UNWATCHED] * sum(len(each.sliding) > 1 for each in model.contacts.values()))]


def degree_within_step(when: Scalar, kernels: Kernels) -> int | None:
    """1 or 2 where a condition is such a polynomial of what is one in time within a step; None for others."""
    if mentions_inputs(when, kernels):
        return None
    degree = degree_of(when, {*kernels.coordinates, *map(rate_name, kernels.coordinates)})
    return max(degree, 1) if degree is not None and degree <= 2 else None


def mentions_inputs(when: Scalar, kernels: Kernels) -> bool:
    """True where a condition has inputs, which may change in any way."""
    from ncgen.model.expressions import is_symbolic, symbols_in

    return bool(is_symbolic(when) and {s.name for s in symbols_in(when)} & set(kernels.inputs))


def most_degree(kernels: Kernels) -> int:
    """Of the polynomials in time that the conditions of a mechanism are within a step."""
    model = kernels.model
    contacts = [when for each in model.contacts.values() for when in (each.forward, *([each.kept] if len(each.sliding) > 1 else []))]
    whens = [*(event.when for event in model.events.values()), *contacts]
    return QUADRATIC if any(degree_within_step(when, kernels) == 2 for when in whens) else LINEAR


def changes_of(events: Sequence[Event]) -> list[tuple[int, str, Scalar]]:
    """(position of the event, name, new value) of all that actions change by expressions."""
    return [(k, *pair) for k, event in enumerate(events) for a in event.do if isinstance(a, Change) for pair in a.values.items()]
