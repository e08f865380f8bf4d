"""Many motions of one mechanism that go on together, step by step, as learning controllers and searches need them.

    sims = ncgen.start(kernels, 256)
    while True:
        sims.step(1e-3, tau=controller(sims["psi"], sims["rate(psi)"]))
        sims.reset(np.abs(sims["psi"]) > 1.0)

A step of all is one call of C for every thread. Each row moves by the same code as a `Simulation`, and so to the same bits.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ConvergenceError, ModelError, NcgenError, counted, shown
from ncgen.mechanism.arguments import numbers
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import STATUS
from ncgen.model.elements import coordinate_of
from ncgen.solver.argument_checks import array_of, checked_kernels, count, echo, has_events, known_name, positive
from ncgen.solver.engines.capabilities import checked_compiled
from ncgen.solver.finite import on_the_way
from ncgen.solver.groups import MotionArguments
from ncgen.solver.motions.alone import Alone
from ncgen.solver.motions.simulation_states import SimulationStates
from ncgen.solver.motions.step_preparation import (
    check_next_step,
    chosen_rows,
    explicit,
    known_text,
    no_such_quantity,
    outputs_at,
    prepared,
    stepped,
    through_events,
)
from ncgen.solver.parameter_checks import refused_parameters
from ncgen.solver.positions.massless import check_mass
from ncgen.solver.runs.grid import MOST_NUMBERS
from ncgen.solver.runs.run import Initial
from ncgen.solver.runs.start import Start, begin
from ncgen.solver.trajectories.output_values import uses_accelerations

if TYPE_CHECKING:
    from ncgen.mechanism.moving import Stepping
    from ncgen.solver.events.steps import Steps
    from ncgen.solver.trajectories.happening import Happening

ARRAYS_OF_C = ("t", "work", "q", "qd", "p")
"""Arrays of `Simulations` that C works on."""


def start_batch(kernels: Kernels, size: int, arguments: Sequence[MotionArguments], threads: int | None) -> Simulations:
    """Start N simulations; arguments: of one start for all, or of N; errors as of `start` with rows."""
    from ncgen.mechanism.kernel_batch import thread_count

    driven = checked_kernels(kernels).driven_by(None)
    size = count(size, "variants")
    if size * (3 * driven.n + len(driven.p0)) > MOST_NUMBERS:
        raise ModelError(
            f"variants: {size} simulations of {driven.n} coordinates take more than {MOST_NUMBERS * 8 / 2**30:.3g} GiB; ask for fewer"
        )
    workers = min(thread_count(threads, "start"), size)
    checked = []
    for row, each in enumerate(arguments):
        with _naming(row, len(arguments)):
            checked.append(stepped(kernels, each))
    integrator, rtol, atol, inputs, _ = checked[0]
    return Simulations(driven, size, workers, integrator, rtol, atol, inputs, [start for *_, start in checked])


@contextmanager
def _naming(row: int, size: int) -> Iterator[None]:
    """Let errors say which of several simulations they are about."""
    try:
        yield
    except NcgenError as error:
        raise type(error)(f"simulation {row}: {error}") if size > 1 else error from None


def _begun(kernels: Kernels, starts: Sequence[Initial], row: int) -> Start:
    """Return the consistent start of a row. Raises what `begin` raises, and ModelError for a part that moves without mass."""
    with _naming(row, len(starts)):
        start = begin(kernels, starts[row], partitioned=False)
        check_mass(kernels, start.q, starts[row].t, start.p)
    return start


class Simulations:
    """Rows of one mechanism at their instants; `start` with rows or `variants` makes them.

    t, work (N,); q, qd (N, n), in the order of `kernels.coordinates`; p (N, n_p): parameters and inputs, a row each. They are what C works
    on and may be written to: copy them to keep them, or take `states`; after writing to q or qd call `project_state`.
    stuck (N,): who could not go on in the last step.
    `sims["psi"]` is a coordinate of all, `sims["rate(psi)"]` its velocity, `sims["tip height"]` an output, `sims["tau"]` an input, (N,).
    With a model that has events, `events` lists those of each, and `stopped` says which an event has ended: these stay where they are.
    """

    _steps: tuple[Steps, ...] = ()

    t: np.ndarray
    work: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    p: np.ndarray

    def __init__(
        self,
        kernels: Kernels,
        size: int,
        threads: int,
        integrator: str,
        rtol: float,
        atol: float | None,
        inputs: Mapping[str, ArrayLike],
        starts: Sequence[Initial],
    ) -> None:
        from ncgen.mechanism.moving import MovingRow, MovingRows

        self.kernels, self.integrator, self.size = kernels, explicit(integrator), size
        stepping, first = prepared(kernels, self.integrator, rtol, atol, starts[0])
        begun = [first, *(_begun(kernels, starts, row) for row in range(1, len(starts)))]
        self._alone = Alone(kernels.name)
        self._now = now = MovingRows([stepping() for _ in range(threads)], size)
        vars(self).update({name: getattr(now, name) for name in ARRAYS_OF_C})
        self._mechanism = checked_compiled(kernels).fingerprint
        self._places = {name: kernels.parameters.index(name) for name in kernels.inputs}
        self.t[:] = starts[0].t
        self.q[:], self.qd[:], self.p[:] = ([getattr(start, name) for start in begun] for name in ("q", "qd", "p"))
        self.drive(**inputs)
        if has_events(kernels.model):
            rows = (MovingRow(now, row) for row in range(size))
            modes: dict[Hashable, Stepping] = {}
            self._steps = tuple(through_events(kernels, self.integrator, rtol, atol, row, modes) for row in rows)
        self._began = self.states

    def __repr__(self) -> str:
        return f"<Simulations {self.kernels.name}: {self.size}, {self.integrator}>"

    def __setattr__(self, name: str, value: object) -> None:
        """Arrays that C works on stay where they are. Raises ModelError with what to write instead."""
        if name in ARRAYS_OF_C:
            raise ModelError(f"sims.{name} cannot be replaced: C works on the array it has; write sims.{name}[:] = array")
        super().__setattr__(name, value)

    def __copy__(self) -> Simulations:
        raise ModelError("simulations are not copied: C works on their memory; start others with ncgen.start and reset them")

    def __deepcopy__(self, memo: object) -> Simulations:
        return self.__copy__()

    def __len__(self) -> int:
        return self.size

    @property
    def stuck(self) -> np.ndarray:
        """Return which simulations could not continue in the last step.

        Returns
        -------
        numpy.ndarray
            Mask, shape (N,): True for a simulation that could not.
        """
        return self._now.statuses != 0

    @property
    def events(self) -> tuple[tuple[Happening, ...], ...]:
        """Of each its events since the start; () for a model without events."""
        return tuple(each.happened for each in self._steps)

    @property
    def stopped(self) -> np.ndarray:
        """Which an event has ended, (N,)."""
        return np.array([each.stopped for each in self._steps] or [False] * self.size)

    def drive(self, /, **inputs: ArrayLike) -> Simulations:
        """Set inputs by name; each keeps its value until it is set again.

        Parameters
        ----------
        **inputs : array_like
            One value or N values by name.

        Returns
        -------
        Simulations
            The simulations themselves.

        Raises
        ------
        ModelError
            For an unknown name, or values that are not numbers; then nothing is changed.
        """
        with self._alone:
            self._drive(inputs)
        return self

    def _drive(self, inputs: dict[str, ArrayLike]) -> None:
        numbers = {name: self._numbers(name, values) for name, values in inputs.items()}
        for name, values in numbers.items():
            self.p[:, self._places[name]] = values

    def _numbers(self, name: str, values: ArrayLike) -> np.ndarray:
        known_name(name, tuple(self._places), "step", "input")
        try:
            array = numbers(values, f"step: {name}")
        except NcgenError:
            raise ModelError(f"step: {name} is {shown(values)}; it must be a number, or {self.size} of them") from None
        if array.shape not in ((), (self.size,)):
            raise ModelError(f"step: {name} has the shape {array.shape}; it must be a number, or {self.size} of them")
        if not np.all(np.isfinite(array)):
            row = int(np.argmin(np.isfinite(np.broadcast_to(array, self.size))))
            raise ModelError(f"step: {name} is {np.broadcast_to(array, self.size)[row]} for simulation {row}; it must be a finite number")
        return array

    def step(self, h: float, /, **inputs: ArrayLike) -> Simulations:
        """Advance all motions.

        If one cannot continue, it stays where it was, `stuck` lists it, and the others have moved.

        Parameters
        ----------
        h : float
            Time to advance (s).
        **inputs : array_like
            One value or N values by name.

        Returns
        -------
        Simulations
            The simulations themselves.

        Raises
        ------
        ConvergenceError
            If a motion cannot continue.
        DomainError
            If a kernel returns NaN or infinity.
        """
        h = positive(h, "h")
        with self._alone:
            if inputs:
                self._drive(inputs)
            if self._steps:
                self._go_through_events(h)
                return self
            moved = self._now.go_on(h)
        if not moved:
            raise self._refused(h)
        return self

    def _go_through_events(self, h: float) -> None:
        """All on by h seconds, one after the other. Raises ConvergenceError for the first that cannot, when the others have moved."""
        raised: dict[int, NcgenError] = {}
        for row, each in enumerate(self._steps):
            try:
                each.go_on(h)
            except NcgenError as error:
                raised[row] = error
            self._now.statuses[row] = STATUS.index("not converged") if row in raised else 0
        if raised:
            row = min(raised)
            more = f" (and {counted(len(raised) - 1, 'other')})" if len(raised) > 1 else ""
            raise ConvergenceError(f"simulation {row} of {self.size}{more}: {raised[row]}") from raised[row]

    def _refused(self, h: float) -> Exception:
        rows = np.flatnonzero(self.stuck)
        row = int(rows[0])
        t, status = float(self.t[row]), STATUS[int(self._now.statuses[row])]
        words = f"simulation {row} of {self.size} does not get on by {h:.6g} s from t = {t:.6g} s ({status})"
        more = f", nor do {len(rows) - 1} others" if len(rows) > 1 else ""
        error = on_the_way(self.kernels, self.q[row], self.qd[row], t, t + h, self.p[row])
        return error or ConvergenceError(f"{self.kernels.name}: {words}{more}; those that are stuck stay where they were: reset them")

    @property
    def states(self) -> SimulationStates:
        """Where all are, as a copy."""
        now = self._now
        t, q, qd, work, p, next_step = (x.copy() for x in (now.t, now.q, now.qd, now.work, now.p, now.next_step))
        return SimulationStates(
            t=t, q=q, qd=qd, work=work, p=p, next_step=next_step, mechanism=self._mechanism, pasts=tuple(each.past for each in self._steps)
        )

    def reset(self, rows: ArrayLike | None = None, states: SimulationStates | None = None) -> Simulations:
        """Return simulations to their start, or to given states.

        From there the same steps give the same bits. After an error nothing has changed.

        Parameters
        ----------
        rows : array_like, optional
            Numbers of simulations, or a mask (N,); None for all.
        states : SimulationStates, optional
            States that `states` returned; None for the start.

        Returns
        -------
        Simulations
            The simulations themselves.

        Raises
        ------
        ModelError
            For rows that do not exist, for states of another mechanism or number of simulations, and for numbers that are not finite.
        """
        chosen, source, now = chosen_rows(rows, self.size, self.kernels.name), self._began if states is None else states, self._now
        if not isinstance(source, SimulationStates):
            raise ModelError(f"reset: {echo(source)} given; give states that were kept, such as kept = sims.states")
        if source.mechanism != self._mechanism:
            raise ModelError(f"reset: the states are those of another mechanism than {self.kernels.name}; give states that this one had")
        names = ("t", "q", "qd", "work", "p", "next_step")
        values = {name: array_of(getattr(source, name), getattr(now, name).shape, f"reset: {name}") for name in names}
        check_next_step(float(np.min(values["next_step"])))
        if refused := {} if np.array_equal(values["p"], now.p) else refused_parameters(self.kernels, values["p"]):
            raise ModelError(f"reset: p of simulation {min(refused)}: {refused[min(refused)]}")
        is_whole = isinstance(source.pasts, tuple) and len(source.pasts) == len(self._steps)
        if not is_whole or not all(each.is_past(past) for each, past in zip(self._steps, source.pasts, strict=True)):
            raise ModelError(f"reset: pasts: {echo(source.pasts)} given; give states that were kept, such as kept = sims.states")
        with self._alone:
            for name, array in values.items():
                getattr(now, name)[chosen] = array[chosen]
            now.statuses[chosen] = 0
            for row in chosen.tolist() if source.pasts else ():
                self._steps[row].go_back(source.pasts[row])
        return self

    def project_state(self, rows: ArrayLike | None = None) -> Simulations:
        """Project q and qd onto the constraints after you wrote to them.

        Parameters
        ----------
        rows : array_like, optional
            Numbers of simulations, or a mask (N,); None for all.

        Returns
        -------
        Simulations
            The simulations themselves.

        Raises
        ------
        ConvergenceError
            For the first simulation whose loops cannot be closed.
        """
        with self._alone:
            for row in chosen_rows(rows, self.size, self.kernels.name).tolist():
                if (status := self._now.project_state(row)) != "ok":
                    problem = f"the loops of simulation {row} do not close at t = {self.t[row]:.6g} s ({status})"
                    raise ConvergenceError(f"{self.kernels.name}: {problem}; start nearer to a closed position")
                self._now.next_step[row] = 0.0
        return self

    @property
    def qdd(self) -> np.ndarray:
        """Accelerations (N, n) with the present inputs. Raises ConvergenceError where there are none."""
        with self._alone:
            if self._steps:
                return np.array([each.accelerations() for each in self._steps])
            for row in range(self.size):
                if (status := self._now.evaluate(row)) != "ok":
                    problem = f"simulation {row} has no accelerations at t = {self.t[row]:.6g} s ({status})"
                    raise ConvergenceError(f"{self.kernels.name}: {problem}")
            return self._now.qdd.copy()

    @property
    def outputs(self) -> dict[str, np.ndarray]:
        """{label: values (N,)} of the model's outputs, one simulation after the other."""
        for each in self._steps:
            each.check_outputs()
        qdd = self.qdd if uses_accelerations(self.kernels.model) else np.zeros_like(self.q)
        rows = [outputs_at(self.kernels, *row) for row in zip(self.t, self.q, self.qd, qdd, self.p, strict=True)]
        return dict(zip(self.kernels.model.outputs, np.array(rows).T, strict=True))

    def __getitem__(self, name: str) -> np.ndarray:
        """A coordinate, rate(…) of one, an output or an input of all (N,), as a copy. Raises ModelError for another name."""
        index, name = self.kernels.index, known_text(name)
        if name in index:
            return self.q[:, index[name]].copy()
        if coordinate_of(name) in index:
            return self.qd[:, index[coordinate_of(name)]].copy()
        if name in self._places:
            return self.p[:, self._places[name]].copy()
        if name in self.kernels.model.outputs:
            return self.outputs[name]
        raise no_such_quantity(self.kernels, name)
