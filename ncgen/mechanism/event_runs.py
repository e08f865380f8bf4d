"""Many motions with events over a grid of times in C (`ncgen_event_runs.h`), in memory of their own: for one thread at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.conditions_in_c import UNWATCHED, Conditions, Watched
from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
from ncgen.mechanism.driving import Driver, Function, InputPieces
from ncgen.mechanism.listening import Listener, watch
from ncgen.mechanism.runtime_library import event_runtime
from ncgen.toolchain.abi import NUMBERS, InC

NOTES = 1024
"""Notes that C takes before Python reads them."""

STATE = 8
"""Numbers of a note before position and velocities."""


@dataclass(frozen=True, kw_only=True)
class EventsInC:
    """The events of a mechanism as C has them.

    actions: (event, name of its kind in C, place, value); law: of several impacts, its name in C; most: velocities that one event sets, or
    the number of events if that is more; n_values: numbers that actions set; watched: the conditions; noise: of these within a step
    derivatives, rates, values: addresses of functions, 0 for none; holds: whether gaps may be held closed, in modes
    held: what may be held, the members of `ncgen_hold`, the mechanism for it, and how many conditions its loads have; None: modes
    follows_loads: whether friction of joints does
    n_velocities: so many conditions, the last ones, are those of joints, contacts and ratchets
    rubbings: contacts with friction, the members of `ncgen_rubbing`; sliding: the address of their velocities, and how many these are
    """

    directions: Sequence[int]
    actions: Sequence[tuple[int, str, int, int]]
    law: str
    most: int
    n_values: int
    watched: Conditions
    noise: float
    derivatives: int
    rates: int
    values: int
    holds: bool
    held: tuple[Sequence[tuple[str, int, int, int, int, int, int]], HeldGaps, int] | None = None
    follows_loads: bool = False
    n_velocities: int = 0
    rubbings: Sequence[Mapping[str, Any]] = ()
    sliding: tuple[int, int] = (0, 0)

    @property
    def count(self) -> int:
        """Of the conditions."""
        return len(self.directions)

    @property
    def n_holds(self) -> int:
        """How many things may be held in one mechanism with switches."""
        return len(self.held[0]) if self.held else 0

    @property
    def most_watched(self) -> int:
        """Conditions that are watched at most: these, and those of the loads that hold gaps and joints."""
        return self.count + (self.held[2] if self.held else self.count)


@dataclass(frozen=True, eq=False, kw_only=True)
class HeldGaps:
    """A mode: numbers of the events whose gaps are held, the mechanism that moves then, the rank of its Φ_q, and the address of the
    conditions with the loads behind them; friction: the address of that which follows loads, 0 for none."""

    held: tuple[int, ...]
    dynamics: ConstrainedDynamics
    rank: int
    conditions: int
    friction: int = 0

    def described(self) -> tuple[InC, InC]:
        """The model and its dynamics, for C."""
        ffi, _ = self.dynamics.interface
        model, described = self.dynamics.described(self.rank)
        if self.friction:
            described.external, described.conservative = ffi.cast("ncgen_velocity_kernel *", self.friction), 0
        return model, described


class Note(NamedTuple):
    """What happened at an event of motion `owner`, or from the number of the conditions on to what may be held; what: 0 it happened, 1 it
    is held from now on, 2 no longer, 3 a joint turns; cause: 0 by its condition, 1 at the start, 2 it follows from others, 3 by its load;
    limit: s, or None; other members as of `Happening`."""

    owner: int
    event: int
    transition: int
    cause: int
    t: float
    impulse: float
    lost: float
    limit: float | None
    q: np.ndarray
    before: np.ndarray
    after: np.ndarray


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionRows:
    """Where motions begin, what drives them, and what becomes of them.

    times (points,): s; q, qd (B, n), p (B, n_p): starts; out_q, out_qd (B, points, n), out_work (B, points)
    inputs: `signals` of `RunInputs`, the same for all; breaks (B,): of each those of its laws (K, 2), s; () where nothing depends on time
    rows, steps (B,): how many there are; ended (B,): s
    """

    times: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    p: np.ndarray
    out_q: np.ndarray
    out_qd: np.ndarray
    out_work: np.ndarray
    rows: np.ndarray
    steps: np.ndarray
    ended: np.ndarray
    inputs: Sequence[InputPieces | Function | None] = ()
    breaks: Sequence[np.ndarray] = ()


class EventRuns:
    """Motions with events, carried out in C one after the other."""

    def __init__(
        self,
        table: EventsInC,
        mechanism: HeldGaps,
        motions: MotionRows,
        options: dict[str, Any],
        sizes: np.ndarray | None,
        listener: Listener,
    ) -> None:
        """mechanism: with nothing held; options: members of `ncgen_options`; sizes (2 n + 1,): what atol is multiplied by"""
        self._ffi, self._library = event_runtime()
        self._table, self._kept, self.listener = table, [motions, sizes], listener
        kernels = mechanism.dynamics.kernels
        self._n, self._n_p, self._modes = kernels.n, len(kernels.p0), [mechanism]
        self._wanted, self._mode, self._stopped = self._integers(2 * table.count), self._integers(1), self._integers(1)
        driving = self._driving(motions)
        settings = self._settings({**options, "signals": driving["signals"]} if driving else options, sizes)
        self._events = self._new("ncgen_events *", **self._described(table))
        self._rows = np.zeros((NOTES, STATE + 3 * self._n))
        sampled = self._watched.struct.formulas.sampled if self._watched.struct.formulas else self._ffi.NULL
        due = self._ints(np.ones(table.count + table.n_holds))
        self._log = self._new("ncgen_log *", room=NOTES, due=due, sampled=sampled, rows=pointer(self._ffi, self._rows.ravel()))
        model, described = mechanism.described()
        self._kept.append(described)
        driven = {"model": model, "dynamics": described, "options": settings}
        self._runs = self._new(
            "ncgen_event_runs *", driven=driven, events=self._events, passage=self._passage(), **self._room_of(motions), **driving
        )
        self._make_room()

    # -- memory ----------------------------------------------------------------------------------------------------------------------------

    def _new(self, kind: str, **members: Any) -> InC:
        made = self._ffi.new(kind, members)
        self._kept.append(made)
        return made

    def _integers(self, count: int) -> np.ndarray:
        return np.zeros(max(count, 1), dtype=np.intc)

    def _at(self, array: np.ndarray) -> InC:
        return pointer(self._ffi, array, "int[]")

    def _ints(self, values: Any) -> InC:
        array = np.array(values if len(values) else [0], dtype=np.intc)
        self._kept.append(array)
        return self._at(array)

    def _reals(self, values: np.ndarray) -> InC:
        array = np.array(values, dtype=float).ravel()
        self._kept.append(array)
        return pointer(self._ffi, array)

    def _function(self, address: int, kind: str = "ncgen_velocity_kernel *") -> InC:
        return self._ffi.cast(kind, address)

    def _settings(self, options: dict[str, Any], sizes: np.ndarray | None) -> InC:
        """The options of all runs, with the conditions that are watched; arrays of these have room for loads."""
        table, ffi = self._table, self._ffi
        most = table.most_watched
        padded = replace(
            table.watched,
            coordinates=np.full(most, -1),
            values=np.zeros(most),
            directions=np.append(table.directions, [UNWATCHED] * (most - table.count)),
            signs=np.zeros(most),
        )
        self._watched = Watched(padded, ffi, NUMBERS["double"])
        self._watched.struct.count = table.count
        self._context = ffi.new_handle(self.listener)
        more = {} if sizes is None else {"sizes": pointer(ffi, sizes)}
        callbacks = {"progress": watch("double"), "context": self._context, "attempts_left": self.listener.attempts}
        return self._new("ncgen_options *", event=self._watched.struct, **callbacks, **more, **options)

    def _driving(self, motions: MotionRows) -> dict[str, Any]:
        """What drives motions; {} where nothing does."""
        if not any(motions.inputs) and not any(map(len, motions.breaks)):
            return {}
        driver, ends = Driver(motions.inputs, NUMBERS["double"]), [np.ravel(each) for each in motions.breaks]
        signals = driver.signals(self._library.ncgen_piecewise_inputs)
        self._kept += [driver, signals]
        first = np.cumsum([0, *map(len, ends)])
        return {"signals": signals, "first_break": self._ints(first), "breaks": self._reals(np.concatenate([*ends, [0.0]]))}

    def _passage(self) -> dict[str, Any]:
        """What C knows of the events of the present motion."""
        table, count = self._table, self._table.count
        values = table.n_values + (self._n + 1) * table.sliding[1]
        workspace = self._library.ncgen_events_workspace(count, table.most, self._n, values)
        due = self._library.ncgen_events_integers(count)
        return {
            "signs": self._watched.struct.signs, "happened": self._ints(np.zeros(count)), "due": self._ints(np.zeros(due)),
            "stopped": self._at(self._stopped), "workspace": self._reals(np.zeros(workspace)), "mode": self._at(self._mode),
            "directions": self._ints(np.zeros(table.most_watched)), "wanted": self._at(self._wanted),
            "room": self._reals(np.zeros(2 * self._n + 2 * table.most_watched)), "log": self._log,
            "ways": self._reals(np.zeros(max(4 * table.n_holds, 1))),
            "flags": self._ints(np.zeros(self._library.ncgen_held_integers(table.n_holds))),
        }  # fmt: skip

    def _room_of(self, motions: MotionRows) -> dict[str, Any]:
        """The arrays of motions, and room for the present one."""
        ffi, points, n = self._ffi, len(motions.times), self._n
        arrays = {name: np.ascontiguousarray(getattr(motions, name)) for name in ("times", "q", "qd", "p")}  # rows may be one repeated
        arrays |= {name: getattr(motions, name) for name in ("out_q", "out_qd", "out_work", "ended")}
        sizes = {"part_times": points + 1, "part_q": (points + 2) * n, "part_qd": (points + 2) * n, "part_work": points + 2}
        sizes |= {"own_p": max(self._n_p, 1), "kept": 3 * n + self._n_p}
        arrays |= {name: np.zeros(size) for name, size in sizes.items()}
        self._p = arrays["own_p"]
        self._own = {name: np.zeros(n) for name in ("q", "qd", "qdd")}
        self._kept.append(arrays)
        integers = {"rows": pointer(ffi, motions.rows, "int[]"), "steps": pointer(ffi, motions.steps, "long[]"), "n_times": points}
        integers |= {"kept_integers": self._ints(np.zeros(6 * self._table.count))}
        moment = {name: pointer(ffi, array) for name, array in self._own.items()}
        return {"moment": moment, **integers, **{name: pointer(ffi, array.reshape(-1)) for name, array in arrays.items()}}

    def _described(self, table: EventsInC) -> dict[str, Any]:
        rows = [
            {"event": event, "kind": getattr(self._library, kind), "place": position, "value": value}
            for event, kind, position, value in table.actions
        ]
        actions = self._ffi.new("ncgen_action[]", rows)
        self._kept.append(actions)
        return {
            "count": table.count, "most": table.most, "n_actions": len(rows), "law": getattr(self._library, table.law),
            "directions": self._ints(table.directions), "actions": actions, "conditions": self._function(table.watched.function or 0),
            "derivatives": self._function(table.derivatives), "rates": self._function(table.rates, "ncgen_forced_kernel *"),
            "values": self._function(table.values), "noise": table.noise, "n_velocities": table.n_velocities, **self._rubbings_in_c(table),
            **(self._held_in_c(table) or self._modes_in_c(table.holds)),
        }  # fmt: skip

    def _rubbings_in_c(self, table: EventsInC) -> dict[str, Any]:
        """Contacts with friction as C has them."""
        rubbings = self._ffi.new("ncgen_rubbing[]", list(table.rubbings))
        self._kept.append(rubbings)
        address, count = table.sliding
        return {"n_rubbings": len(table.rubbings), "rubbings": rubbings, "n_sliding": count, "sliding": self._function(address)}

    def _held_in_c(self, table: EventsInC) -> dict[str, Any]:
        """What may be held in one mechanism with switches, as C has it."""
        if table.held is None:
            return {}
        holds, mechanism, loads = table.held
        names = ("condition", "on", "held", "value", "slip", "load")
        rows = [{"kind": getattr(self._library, kind), **dict(zip(names, rest, strict=True))} for kind, *rest in holds]
        model, dynamics = mechanism.described()
        members = {"holds": self._ffi.new("ncgen_hold[]", rows), "held_model": model, "held_dynamics": dynamics}
        self._kept.append(members)
        self._modes.append(mechanism)
        counts = {"n_holds": len(rows), "n_loads": loads, "follows_loads": table.follows_loads, "rubs": mechanism.friction != 0}
        return {**members, **counts, "held_conditions": self._function(mechanism.conditions)}

    def _modes_in_c(self, holds: bool) -> dict[str, Any]:
        """The modes as C has them; where gaps may be held, an empty one comes first, which no gaps choose."""
        if not holds:
            return {"n_modes": 0}
        described: list[dict[str, Any]] = [{"count": 0}]
        for mode in self._modes[1:]:
            model, dynamics = mode.described()
            self._kept.append(dynamics)
            described.append({
                "count": len(mode.held), "held": self._ints(mode.held), "model": model, "dynamics": dynamics,
                "conditions": self._function(mode.conditions),
            })  # fmt: skip
        self._in_c = self._ffi.new("ncgen_mode[]", described)
        return {"n_modes": len(described), "modes": self._in_c}

    def _make_room(self) -> None:
        """Workspace for all modes."""
        runs, library, ffi = self._runs, self._library, self._ffi
        sizes, rows = [], 0
        for mode in self._modes:
            model, dynamics = mode.described()
            driven = ffi.new("ncgen_driven *", {"model": model, "dynamics": dynamics, "options": runs.driven.options})
            sizes += [library.ncgen_driven_workspace(driven), library.ncgen_workspace(model, dynamics, runs.driven.options)]
            rows = max(rows, mode.dynamics.kernels.m)
        self._workspace, self._room = np.empty(max(sizes)), self._integers(7 * self._n + 3 * rows)
        runs.driven.workspace, runs.driven.integers = pointer(ffi, self._workspace), self._at(self._room)

    # -- motions ---------------------------------------------------------------------------------------------------------------------------

    def take(self, first: int, last: int) -> None:
        """The motions from `first` to before `last` are next."""
        self._runs.at, self._runs.count, self._runs.begun = first, last, 0

    def go_on(self) -> str:
        """Return "ok" where all have come to their ends, "mode" where one needs a mode that it does not have, "full" where notes have to be
        read first, or else "failed". Raises what ended it from outside."""
        status = self._library.ncgen_go_on_with_runs(self._runs)
        if self.listener.raised:
            raise self.listener.raised
        named = {0: "ok", self._library.NCGEN_AT_REST: "mode", self._library.NCGEN_LOG_FULL: "full"}
        return named.get(status, "failed")

    @property
    def at(self) -> int:
        """The number of the present motion."""
        return int(self._runs.at)

    def skip(self) -> None:
        """Leave the present motion."""
        self._runs.at, self._runs.begun = self._runs.at + 1, 0

    @property
    def wanted(self) -> tuple[int, ...]:
        """The events whose gaps a mode is to hold."""
        return tuple(np.flatnonzero(self._wanted[: self._table.count]).tolist())

    @property
    def held(self) -> set[tuple[int, ...]]:
        """The modes that there are."""
        return {mode.held for mode in self._modes}

    @property
    def state(self) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """t (s), q and qd (n,), p (n_p,) of the present motion where its last part began."""
        return self._runs.moment.t, self._own["q"].copy(), self._own["qd"].copy(), self._p[: self._n_p].copy()

    def add(self, mode: HeldGaps) -> None:
        """Give it one more mode."""
        self._modes.append(mode)
        for name, value in self._modes_in_c(True).items():
            setattr(self._events, name, value)
        self._make_room()

    def notes(self) -> list[Note]:
        """Those that have come since the last call."""
        rows, self._log.count = self._rows[: self._log.count].copy(), 0
        n, notes = self._n, []
        numbers = rows[:, :STATE].tolist()
        states = rows[:, STATE:].reshape(len(rows), 3, n)
        for (owner, event, transition, cause, t, impulse, lost, limit), (q, before, after) in zip(numbers, states, strict=True):
            ends = None if limit < 0 else t + limit
            notes.append(Note(int(owner), int(event), int(transition), int(cause), t, impulse, lost, ends, q, before, after))
        return notes
