"""Many motions of a mechanism with events, each carried out in C from event to event, on several threads.

C has what tables can say: impacts, gaps that are held closed, other parameters, inputs and velocities, the end of a motion. A mode is
compiled when a motion first needs it. What C cannot carry out is left to a run of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Any

import numpy as np

from ncgen.errors import NcgenError
from ncgen.mechanism.break_times import break_times
from ncgen.mechanism.driver_jumps import has_driver_jumps, may_jump
from ncgen.mechanism.driving import InputPieces
from ncgen.mechanism.event_runs import EventRuns, EventsInC, HeldGaps, MotionRows, Note
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.listening import REACTION, Listener
from ncgen.mechanism.program_functions import CompiledFunctions
from ncgen.mechanism.program_functions import functions as functions_of
from ncgen.methods.method import Method, settings_in_c
from ncgen.methods.table import number_in_c
from ncgen.model.actions import Change, Impact, Locking, Stop
from ncgen.model.digest import digest_of_events
from ncgen.model.values import Scalar
from ncgen.program.ir.blocks import Program
from ncgen.program.motions.event_programs import assemble_conditions
from ncgen.solver.engines import acceleration_forms, capabilities
from ncgen.solver.events import on_demand
from ncgen.solver.events.action_rows import Actions
from ncgen.solver.events.conditions import EventFunctions
from ncgen.solver.events.event_table import EventTable
from ncgen.solver.events.held_mechanism import refusal_of_frictions, refusal_of_shared, with_switches
from ncgen.solver.events.holdables import Holdable
from ncgen.solver.events.modes import load_conditions, rank_of, variant
from ncgen.solver.events.state import State
from ncgen.solver.loads.constraint_loads import refusal_of_multipliers
from ncgen.solver.parameter_checks import judged_parameters
from ncgen.solver.runs.run import Run
from ncgen.solver.runs.tolerances import Tolerances
from ncgen.solver.trajectories.happening import GAPS, JOINTS, LOCKS, RATCHETS, Happening, Search

CHUNK = 16
"""Motions of one call of C, between which a batch can be ended and says how far it has come."""

SEARCHES: tuple[Search, ...] = ("polynomial", "start", "action", "sampled")
"""How an event was found, by the numbers of C; the first one is what the condition allows."""


def refusal_in_c(kernels: Kernels) -> str | None:
    """Why motions with the events of a mechanism are not carried out in C as a whole, in words, or None."""
    model = kernels.model
    if not all(isinstance(action, (Change, Impact, Locking, Stop)) for event in model.events.values() for action in event.do):
        return "an event does what no table can say"
    if model.callbacks or model.branches:
        return "the mechanism calls Python functions, or chooses its rows anew between steps"
    if len(kernels.holonomic) < kernels.m or refusal_of_multipliers(kernels):
        return "there are rolling conditions, or more unknowns than are emitted"
    if Actions.of(kernels).changed(kernels) & judged_parameters(kernels):
        return "events change parameters that have conditions"
    if any(friction.load is not None for friction in model.frictions.values()) and (why := refusal_of_shared(kernels, kernels.q0)):
        return why
    return refusal_of_frictions(model) or None


@dataclass(eq=False, kw_only=True)
class ManyRuns:
    """Motions of a mechanism over the times of a run.

    stop_when_stiff: whether motions that are found stiff are left to single runs
    carried: {number of a motion that C carried out: its events}
    """

    kernels: Kernels
    run: Run
    method: Method
    motions: MotionRows
    stop_when_stiff: bool = False
    carried: dict[int, tuple[Happening, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._drive()
        model = self.kernels.model
        self._exported = self._with_switches() if model.frictions or model.contacts or model.ratchets or model.locks else None
        kernels = self.kernels
        self.functions = EventFunctions(kernels)
        self._lock, self._ended, self._done = Lock(), False, 0
        self._searches = self.functions.searches
        self._names_and_words = self._words()
        tolerances = Tolerances.of(self.run, kernels.length, capabilities.rounding("double")).in_c(
            kernels.column_sizes, kernels.column_sizes
        )
        self._sizes = tolerances.pop("sizes")
        step = self.run.settings.max_step
        self._options = {
            "method": number_in_c(self.method.integrator), "formalism": number_in_c(self.method.formalism),
            "tolerance": capabilities.closeness("double"), "max_step": 0.0 if np.isinf(step) else step,
            "stop_when_stiff": int(self.stop_when_stiff),
            **settings_in_c(self.method.options), **tolerances,
        }  # fmt: skip
        if kernels.model.beginnings and not self._exported:
            driven = EventFunctions(kernels.driven_by(self.run.signals))
            for i, p in enumerate(self.motions.p):
                for name, value in driven.beginnings(self._start(i)).items():
                    p[kernels.parameters.index(name)] = value

    def _drive(self) -> None:
        """Give the motions what drives them: inputs, and the breaks of their laws. Drivers whose velocity jumps are left to single runs."""
        kernels, motions, signals = self.kernels, self.motions, self.run.signals
        laws, (start, end) = signals.laws if signals else (), motions.times[[0, -1]].tolist()
        breaks = [break_times(kernels, p, start, end, laws) for p in motions.p]
        self._left = set[int]()
        if may_jump(kernels):
            self._left = {i for i, each in enumerate(breaks) if has_driver_jumps(kernels, motions.p[i], motions.q[i], each)}
        if any(laws) or any(map(len, breaks)):
            self.motions = replace(motions, inputs=signals.functions if signals else (), breaks=breaks)

    def carry_out(self, threads: int, progress: Callable[[float], None] | None) -> None:
        """All of them. Raises what is raised meanwhile, with those that are done in `carried`."""
        count = len(self.motions.q)
        ends = [*range(0, count, CHUNK), count]
        chunks = iter(list(zip(ends[:-1], ends[1:], strict=True)))
        asks_python = any(callable(each) and not isinstance(each, InputPieces) for each in self.motions.inputs)
        workers = 1 if asks_python else min(threads, len(ends) - 1)
        if workers == 1:
            self._work(chunks, progress)
            return
        with ThreadPoolExecutor(workers) as pool:
            futures = [pool.submit(self._work, chunks, None) for _ in range(workers)]
            try:
                while any(not each.done() for each in futures):
                    wait(futures, REACTION)
                    if progress:
                        progress(self._done / count)
                for each in futures:
                    each.result()
            finally:
                self._ended = True

    # -- in one thread -----------------------------------------------------------------------------------------------------------------

    def _work(self, chunks: Any, progress: Callable[[float], None] | None) -> None:
        """Chunks of motions as long as there are some."""

        def heard(t: float) -> None:
            if self._ended:
                raise KeyboardInterrupt
            if progress:
                progress(self._done / len(self.motions.q))

        with self._lock:
            runs = EventRuns(self._table, self._mechanism, self.motions, self._options, self._sizes, Listener(heard, self.kernels.n))
        while not self._ended:
            with self._lock:
                chunk = next(chunks, None)
            if chunk is None:
                return
            self._carry(runs, *chunk)
            with self._lock:
                self._done += chunk[1] - chunk[0]
            heard(0.0)

    def _carry(self, runs: EventRuns, first: int, last: int) -> None:
        notes: dict[int, list[Note]] = {i: [] for i in range(first, last)}
        refused = set(self._left)

        def read() -> bool:
            new = runs.notes()
            for note in new:
                notes[note.owner].append(note)
            return bool(new)

        for k, end in self._without_jumps(first, last):
            runs.take(k, end)
            while (status := runs.go_on()) != "ok":
                if (status == "full" and read()) or (status == "mode" and self._adds(runs)):
                    continue
                refused.add(runs.at)
                runs.skip()
        read()
        for i in range(first, last):
            if i not in refused:
                self.carried[i] = self._happenings(notes[i])

    def _without_jumps(self, first: int, last: int) -> Iterator[tuple[int, int]]:
        """The parts of a chunk between motions that are left to single runs."""
        for end in [*(i for i in sorted(self._left) if first <= i < last), last]:
            if first < end:
                yield first, end
            first = end + 1

    def _words(self) -> list[tuple[str, tuple[str, ...]]]:
        """Of every number that notes have: a name, and what may happen by the numbers of C, first what an event does."""
        model, functions = self.kernels.model, self.functions
        locking = [[LOCKS[not action.closes] for action in event.do if isinstance(action, Locking)] for event in functions.events]
        pairs = [(event.name, (words[-1] if words else "", *GAPS)) for event, words in zip(functions.events, locking, strict=True)]
        pairs += [(name, ("", *JOINTS)) for name in (*model.frictions, *model.contacts)]
        pairs += [(name, ("", *RATCHETS)) for name in model.ratchets] + [(name, ("", *JOINTS)) for name in map(str, functions.turns)]
        return pairs + [(each.name, ("", *LOCKS)) for each in (self._exported.holdables if self._exported else ())]

    def _happenings(self, notes: list[Note]) -> tuple[Happening, ...]:
        """Those of a motion; where bounces end in a contact, the limit is also that of its sticking at this instant."""
        happened = tuple(map(self._happening, notes))
        if not self.kernels.model.contacts:
            return happened
        limits = {(each.t, each.name): each.limit for each in happened if each.limit is not None}
        return tuple(replace(each, limit=limits[key]) if (key := (each.t, each.name)) in limits else each for each in happened)

    def _happening(self, note: Note) -> Happening:
        search = SEARCHES[note.cause] if note.cause else self._searches[note.event]
        name, words = self._names_and_words[note.event]
        transition = "" if note.impulse > 0 else words[note.transition]
        return Happening(
            t=note.t,
            name=name,
            search=search,
            q=note.q,
            before=note.before,
            after=note.after,
            impulse=note.impulse,
            energy_lost=note.lost,
            limit=note.limit,
            transition=transition,
        )

    # -- what C is given ---------------------------------------------------------------------------------------------------------------

    def _with_switches(self) -> EventTable:
        """The table of what may be held in one mechanism with switches, which takes the place of the mechanism from here on."""
        mechanism, motions = self.kernels, self.motions

        def made() -> Kernels:
            return on_demand.compiled(with_switches(mechanism.model), backend="c", effort=mechanism.effort)

        self.kernels = kernels = mechanism.remember("with switches", (), made)
        p = np.tile(kernels.p0, (len(motions.q), 1))
        p[:, [kernels.parameters.index(name) for name in mechanism.parameters]] = motions.p
        self.motions = replace(motions, p=p)
        return kernels.remember("events with switches", (), lambda: EventTable(kernels, kernels.programs.equations))

    @property
    def _table(self) -> EventsInC:
        functions, actions, exported = self.functions, Actions.of(self.kernels), self._exported
        address = {name: functions.address(name) for name in ("condition_derivatives", "condition_rates")}
        rows, values = (exported.rows, exported.values) if exported else (actions.rows, actions.values)
        count = functions.count
        return EventsInC(
            directions=functions.directions.tolist(),
            actions=[(row.event, row.kind, row.index, row.value) for row in rows],
            law=actions.law,
            most=max(actions.most, count),
            n_values=len(values),
            noise=actions.noise,
            watched=functions.watched(np.zeros(count), None, functions.directions, None),
            derivatives=address["condition_derivatives"],
            rates=address["condition_rates"],
            values=self._values(values),
            holds=bool(functions.rows),
            held=self._held(exported) if exported and exported.held else None,
            follows_loads=bool(exported and exported.follows_loads),
            n_velocities=count - len(functions.events),
            rubbings=[vars(row) for row in exported.rubbing_rows] if exported else (),
            sliding=(functions.address("contact_velocities"), len(exported.sliding)) if exported and exported.sliding else (0, 0),
        )

    def _values(self, values: list[tuple[str, Scalar]]) -> int:
        """The address of the function of numbers that C asks for, 0 where there are none."""
        if not values:
            return 0
        equations = self.kernels.programs.equations
        make = lambda: assemble_conditions(equations, [], [], values, [])["element_values"]  # noqa: E731
        return self._compiled(self.kernels, "actions", make, len(values))

    def _held(self, exported: EventTable) -> tuple[list[tuple[str, int, int, int, int, int, int]], HeldGaps, int]:
        """What may be held, the mechanism for it, and how many conditions its loads have."""
        rows = [(row.kind, row.condition, row.on, row.held, row.value, row.slip, row.load) for row in exported.hold_rows]
        mechanism, loads = exported.held, len(exported.loads)
        assert mechanism, "something may be held"
        kernels = self.kernels.remember("held with switches", (), lambda: on_demand.compiled(mechanism.sources, backend="c"))
        made = self._compiled(kernels, "held_conditions", lambda: mechanism.programs[0], 2 * (self.functions.count + loads))
        dynamics = acceleration_forms.all_coordinates(kernels, form="dense", integrator=self.method.integrator.name)
        friction = self._compiled(kernels, "held_friction", lambda: mechanism.programs[1], kernels.n) if exported.rubs else 0
        return rows, HeldGaps(held=(), dynamics=dynamics, rank=-1, conditions=made, friction=friction), loads

    def _compiled(self, kernels: Kernels, kind: str, make: Callable[[], Program], size: int) -> int:
        """The address of a function of a state, made once for the events of a mechanism: equations do not tell events from others."""
        counts, model = {"q": kernels.n, "qd": kernels.n, "p": len(kernels.p0)}, self.kernels.model

        def made() -> tuple[int, CompiledFunctions]:
            program, digest = make(), digest_of_events(model)
            assert digest, "what events do is data"
            name, sizes, inputs = program.name, {program.name: size}, {program.name: program.inputs}
            functions = functions_of(kernels, f"{kind}_{digest[:16]}", inputs, sizes, counts, lambda: {name: program})
            assert isinstance(functions, CompiledFunctions), "events need compiled kernels"
            return functions.address(name), functions

        return kernels.remember("functions of many runs", kind, made)[0]

    def _start(self, i: int) -> State:
        motions = self.motions
        return State(t=float(motions.times[0]), q=motions.q[i], qd=motions.qd[i], p=motions.p[i])

    @property
    def _mechanism(self) -> HeldGaps:
        kernels = self.kernels
        finite = np.flatnonzero(np.isfinite(self.motions.q).all(axis=1) & np.isfinite(self.motions.qd).all(axis=1))
        return self._mode((), kernels, self._start(int(finite[0]) if len(finite) else 0), 0)

    def _mode(self, held: tuple[int, ...], kernels: Kernels, at: State, conditions: int) -> HeldGaps:
        dynamics = acceleration_forms.all_coordinates(
            kernels, form=acceleration_forms.form_of(kernels, self.method), integrator=self.method.integrator.name
        )
        return HeldGaps(held=held, dynamics=dynamics, rank=rank_of(self.kernels, kernels, at), conditions=conditions)

    def _adds(self, runs: EventRuns) -> bool:
        """Whether the mode that a motion needs could be added."""
        wanted = runs.wanted
        with self._lock:
            rows: dict[int, Holdable] = {row.number: row for row in self.functions.rows}
            if not wanted or wanted in runs.held or not set(wanted) <= set(rows):
                return False
            held = tuple(rows[k] for k in wanted)
            try:
                kernels = variant(self.kernels, held)
                if refusal_of_multipliers(kernels):
                    return False
                loads = load_conditions(self.functions, kernels, held)
                t, q, qd, p = runs.state
                runs.add(self._mode(wanted, kernels, State(t=t, q=q, qd=qd, p=p), loads.address))
            except (NcgenError, np.linalg.LinAlgError):
                return False  # which the run of its own says in words
        return True
