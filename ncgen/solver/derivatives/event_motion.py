"""A motion with events and its derivatives: motions of the modes between events, joined by the Jacobians of their instants.

The motion is simulated first, which finds the events. Then every part between two of them is a motion of its own that can be
differentiated, by steps over the times of the grid, from the state in which the simulation left the event.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.taped import Driven
from ncgen.solver.derivatives.event_jacobians import EventJacobian, EventJacobians
from ncgen.solver.derivatives.partitioned_motion import PartitionedMotion
from ncgen.solver.derivatives.taped_motion import TapedMotion
from ncgen.solver.events.state import Occurrence, State
from ncgen.solver.motions.simulate import simulate_events
from ncgen.solver.runs.run import Initial
from ncgen.solver.runs.signals import Signals

FINE = 1e-11
"""rtol of the simulation that finds events, at most: states at which an event is differentiated should be those of the steps before it."""

SAME_INSTANT = 1e-13
"""Events nearer than this fraction of the motion's length happen at one instant."""

APPROACH = 7
"""Decimal powers by which steps come closer to where a contact in space comes to rest, and the direction of its friction ends: a straight
line through the last two leaves 1e-13 of the way, and rounding of the direction 1e-9."""

AT_REST = 1e-14
"""Where no velocity is above this fraction of the greatest one of all instants, velocities are rounding."""

Smooth: TypeAlias = TapedMotion | PartitionedMotion

MakeSmooth: TypeAlias = Callable[[Kernels, Initial, np.ndarray, bool], Smooth]
"""From kernels, a start, times of a grid (s), and whether the position at the start is the model's own."""


@dataclass(frozen=True, eq=False, kw_only=True)
class EventSensitivity:
    """How an event changes, columns in the order of `Sensitivities.names`.

    t: s; name: of the event; what: of modes, as in `run.events`
    t_by (columns,): derivatives of its time; q_by, before_by, after_by (n, columns): of the position, and of the velocities before and
        after it, at the event itself, which moves
    """

    t: float
    name: str
    transition: str
    t_by: np.ndarray
    q_by: np.ndarray
    before_by: np.ndarray
    after_by: np.ndarray

    def __repr__(self) -> str:
        label = f"{self.name} {self.transition}".strip()
        return f"<{label} at {self.t:.9g} s, moved by {np.max(np.abs(self.t_by), initial=0.0):.6g} at most>"


@dataclass(frozen=True, eq=False)
class _Grid:
    """Times (s) of a part, when it ends, and numbers of the instants of the grid in it."""

    times: np.ndarray
    end: float
    rows: np.ndarray


@dataclass(frozen=True, eq=False)
class _Part:
    """A motion between events: rows: numbers of the instants of the grid in it; places: where they are among its own; end: of time, which
    the motion of a contact in space that comes to rest only comes close to"""

    motion: Smooth
    rows: np.ndarray
    positions: np.ndarray
    end: float

    @property
    def last(self) -> np.ndarray:
        """Weights (2,) of the last two instants with which changes at the end follow from changes there, as a straight line."""
        before, last = self.end - self.motion.t[-2:]
        return np.array([-last, before]) / (before - last)

    def seeds(self, change: np.ndarray) -> np.ndarray:
        """Changes of parameters, z and rates at its start, of those of [q; q̇; p]."""
        n, columns = self.motion.kernels.n, self._independent
        return np.vstack([change[2 * n :], change[columns[0]], change[n + columns[1]]])

    def weights(self, derivatives: np.ndarray) -> np.ndarray:
        """Derivatives by [q; q̇; p] at its start, of those by parameters, z and rates."""
        n, count, (z, rates) = self.motion.kernels.n, len(self.motion.p), self._independent
        weights_at_start = np.zeros(2 * n + count)
        weights_at_start[2 * n :], weights_at_start[z], weights_at_start[n + rates] = np.split(derivatives, [count, count + len(z)])
        return weights_at_start

    @property
    def _independent(self) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the coordinates z, and of those whose rates are independent."""
        index, names = self.motion.kernels.index, self.motion.names[len(self.motion.p) :]
        z = [name for name in names if name in index]
        rates = [name[len("rate(") : -1] for name in names[len(z) :]]
        return np.array([index[name] for name in z], dtype=int), np.array([index[name] for name in rates], dtype=int)


class EventMotion:
    """A motion through events, seen at the instants of a grid; members as of `TapedMotion`."""

    def __init__(
        self, kernels: Kernels, initial: Initial, times: np.ndarray, follows: bool, signals: Signals | None, make: MakeSmooth,
        arguments: dict[str, Any],
    ) -> None:  # fmt: skip
        """make: makes the motion between two events; arguments: of the simulation"""
        self.kernels, self.t, self.signals = kernels, times, signals
        laws = signals.laws if signals else ()
        first = len(kernels.p0) - len(laws)
        driven = [first + i for i, signal in enumerate(laws) if signal is not None]
        self._jacobians = EventJacobians(kernels.driven_by(signals), driven, float(times[-1] - times[0]))
        passage = simulate_events(kernels, times, **arguments)
        self.instants, begun = passage.instants, passage.begun
        assert begun is not None, "a run with events has begun"
        self._check()
        self._begun = make(kernels, initial, times[:2], follows)
        self.p, self.names, self._first = self._begun.p, self._begun.names, self._jacobians.begun(begun)
        self._parts = list(self._split(make, begun, replace(initial, p=begun.p), follows))
        self._through: list[EventJacobian] = [self._jacobians(o, self._approach(k)) for k, o in enumerate(self.instants)]
        self.q, self.qd = (self._on_the_grid([getattr(segment.motion, name) for segment in self._moving]) for name in ("q", "qd"))

    def _check(self) -> None:
        """Raise ModelError where events end the motion, or coincide."""
        length = float(self.t[-1] - self.t[0])
        for k, o in enumerate(self.instants):
            names, t = o.names, o.before.t
            if o.stops:
                raise ModelError(f"{self.kernels.name}: the event {names} ends the motion at t = {t:.9g} s; take a shorter motion")
            if k and o.crossed and t - self.instants[k - 1].before.t <= SAME_INSTANT * length and self.instants[k - 1].crossed:
                before = self.instants[k - 1].names
                raise ModelError(
                    f"{self.kernels.name}: there is no derivative through the events {before} and {names}, which happen at one instant, "
                    f"t = {t:.9g} s; move one of them"
                )

    @property
    def _moving(self) -> list[_Part]:
        """Parts in which time passes."""
        return [segment for segment in self._parts if segment is not None]

    def _split(self, make: MakeSmooth, start: State, initial: Initial, follows: bool) -> Iterator[_Part | None]:
        """The part before each of the instants, and the one after the last; None where no time passes. start: with which events begin"""
        ends = [*(o.before.t for o in self.instants), float(self.t[-1])]
        begun, at, mode = float(self.t[0]), None, self._jacobians.mode(start, ())
        for k, end in enumerate(ends):
            is_last = k == len(self.instants)
            rows = np.flatnonzero((self.t >= begun) & ((self.t <= end) if is_last else (self.t < end)))
            grid = self._grid(begun, end, rows, None if is_last else self.instants[k])
            yield self._part(make, grid, self._start_of(at, begun, initial), follows and at is None, mode)
            if not is_last:
                at = self.instants[k].after
                begun, mode = at.t, self._jacobians.mode(at, self.instants[k].held)

    def _start_of(self, at: State | None, t: float, initial: Initial) -> Initial:
        if at is None:
            return initial
        sizes = self.kernels.column_sizes
        fastest = max(o.before.speed(sizes) for o in self.instants)
        is_at_rest = at.speed(sizes) <= AT_REST * fastest
        return Initial(p=at.p, q=at.q, t=t, qd=0 * at.qd if is_at_rest else at.qd)

    def _part(self, make: MakeSmooth, grid: _Grid, initial: Initial, follows: bool, mode: Kernels) -> _Part | None:
        rows, times = grid.rows, grid.times
        if len(times) > 1:
            return _Part(make(mode, initial, times, follows), rows, np.searchsorted(times, self.t[rows]), grid.end)
        if not len(rows):
            return None
        after = np.array([times[0], times[0] + float(np.min(np.diff(self.t))) / 1000])  # an event happens at the end of the motion
        return _Part(make(mode, initial, after, False), rows, rows * 0, float(after[-1]))

    def _grid(self, begun: float, end: float, rows: np.ndarray, o: Occurrence | None) -> _Grid:
        """Of the grid of a part, which steps towards where a contact in space comes to rest, but not onto it. o: that ends it"""
        times = np.unique(np.concatenate([[begun], self.t[rows], [end]]))
        if o is not None and len(times) > 1 and self._jacobians.resting_in_space(o):
            times = np.concatenate([times[:-1], end - (end - times[-2]) * 10.0 ** -np.arange(1, APPROACH + 1)])
        return _Grid(times, end, rows)

    def _approach(self, k: int) -> tuple[State, ...]:
        """Two states close to where a contact in space comes to rest at an instant; none for other instants."""
        segment, o = self._parts[k], self.instants[k]
        if segment is None or not self._jacobians.resting_in_space(o):
            return ()
        motion = segment.motion
        return tuple(replace(o.before, t=float(motion.t[i]), q=motion.q[i], qd=motion.qd[i]) for i in (-2, -1))

    def _on_the_grid(self, of_parts: Sequence[np.ndarray]) -> np.ndarray:
        """Rows at the instants of the grid, of those of all parts."""
        on_grid = np.empty((len(self.t), *of_parts[0].shape[1:]))
        for segment, rows in zip(self._moving, of_parts, strict=True):
            on_grid[segment.rows] = rows[segment.positions]
        return on_grid

    # -- derivatives ---------------------------------------------------------------------------

    def along(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As of `TapedMotion`."""
        parts_along: list[tuple[np.ndarray, np.ndarray]] = []
        for segment, change in self._walk(directions):
            if isinstance(segment, _Part):
                parts_along.append(change)
        first, second = (self._on_the_grid([rows[i] for rows in parts_along]) for i in (0, 1))
        return first, second

    def events_along(self, directions: np.ndarray) -> tuple[EventSensitivity, ...]:
        """How all that happened changes along directions (columns, D)."""
        n, sensitivities = self.kernels.n, list[EventSensitivity]()
        for o, change in self._walk(directions):
            if not isinstance(o, Occurrence):
                continue
            jacobian = self._through[self.instants.index(o)]
            time, before, after = jacobian.time @ change, jacobian.before @ change, jacobian.after @ change
            for each in o.happened:
                sensitivities.append(
                    EventSensitivity(
                        t=each.t,
                        name=each.name,
                        transition=each.transition,
                        t_by=time,
                        q_by=before[:n],
                        before_by=before[n : 2 * n],
                        after_by=after[n : 2 * n],
                    )
                )
        return tuple(sensitivities)

    def _walk(self, directions: np.ndarray) -> Iterator[tuple[Any, Any]]:
        """Every part with changes of q and q̇ at all its times, and every instant with the changes of [q; q̇; p] before it."""
        n, count = self.kernels.n, len(self.p)
        dq, dqd = self._begun.along(directions)
        change = self._first @ np.vstack([dq[0], dqd[0], np.vstack([directions, np.zeros((count, directions.shape[1]))])[:count]])
        for k, segment in enumerate(self._parts):
            if segment is not None:
                rows = segment.motion.along(segment.seeds(change))
                yield segment, rows
                ends = (np.tensordot(segment.last, changes[-2:], 1) for changes in rows)
                change = np.vstack([*ends, change[2 * n :]])
            if k < len(self.instants):
                yield self.instants[k], change
                change = self._through[k].through @ change

    def backward(self, by_q: np.ndarray, by_qd: np.ndarray, by: Iterable[str] | None = None) -> tuple[np.ndarray, Driven]:
        """As of `TapedMotion`."""
        n, names = self.kernels.n, None if by is None else list(by)
        weights, driven = np.zeros(2 * n + len(self.p)), list[Driven]()
        for k in reversed(range(len(self._parts))):
            if k < len(self.instants):
                weights = self._through[k].through.T @ weights
            segment = self._parts[k]
            if segment is None:
                continue
            by_state = np.zeros((2, len(segment.motion.t), n))
            by_state[:, -2:] = segment.last[:, None] * weights[: 2 * n].reshape(2, 1, n)
            by_state[0, segment.positions] += by_q[segment.rows]
            by_state[1, segment.positions] += by_qd[segment.rows]
            derivatives, felt = segment.motion.backward(by_state[0], by_state[1], names)
            more, driven = segment.weights(derivatives), [felt, *driven]
            more[2 * n :] += weights[2 * n :]
            weights = more
        by_state, weights = np.zeros((2, len(self._begun.t), n)), self._first.T @ weights
        by_state[0, 0], by_state[1, 0] = weights[:n], weights[n : 2 * n]
        derivatives, _ = self._begun.backward(by_state[0], by_state[1], names)
        derivatives[: len(self.p)] += weights[2 * n :]
        return derivatives, Driven.joined(driven)
