"""A motion that is advanced step by step, driven from outside: by a controller, in a game, next to another simulation.

    sim = ncgen.start(kernels)
    for k in range(1000):
        sim.step(1e-3, tau=controller(sim["psi"], sim["rate(psi)"]))

A step is one call of C. It finds out nothing about the mechanism that is not known when the simulation starts.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Unpack

import numpy as np

from ncgen.errors import ConvergenceError, ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.elements import coordinate_of
from ncgen.solver.argument_checks import array_of, checked_kernels, echo, finite, has_events, known_name, positive
from ncgen.solver.engines import capabilities
from ncgen.solver.finite import on_the_way
from ncgen.solver.formalisms.impulse import Impulse
from ncgen.solver.groups import MotionArguments
from ncgen.solver.motions.alone import Alone
from ncgen.solver.motions.simulation_states import SimulationState
from ncgen.solver.motions.step_preparation import (
    check_next_step,
    explicit,
    known_text,
    no_such_quantity,
    outputs_at,
    prepared,
    stepped,
    through_events,
)
from ncgen.solver.parameter_checks import check_parameters
from ncgen.solver.runs.run import Initial
from ncgen.solver.trajectories.output_values import uses_accelerations

if TYPE_CHECKING:
    from ncgen.solver.events.steps import Steps
    from ncgen.solver.trajectories.happening import Happening


REPLACED = {
    "q": "sim.q[:] = array and then sim.project_state(), or sim.reset(state)",
    "qd": "sim.qd[:] = array and then sim.project_state(), or sim.reset(state)",
    "p": "sim.drive(name=value) for an input, or start again with p={name: value} for a parameter",
    "t": "sim.reset(dataclasses.replace(sim.state, t=seconds))",
    "work": "sim.reset(dataclasses.replace(sim.state, work=joules))",
    "qdd": "an input or a state: accelerations follow from them",
}
"""{member of a simulation: what to write in place of an assignment to it}."""

UNCOPIED = "a simulation is not copied: C works on its memory; start another one with ncgen.start and reset it to sim.state"


def start_one(kernels: Kernels, **arguments: Unpack[MotionArguments]) -> Simulation:
    """Start one simulation; arguments and errors as of `start` without rows."""
    return Simulation(checked_kernels(kernels).driven_by(None), *stepped(kernels, arguments))


class Simulation:
    """A mechanism at an instant, which moves as its methods say; `start` makes one.

    t: s; q, qd (n,): position and velocities, in the order of `kernels.coordinates`; work: J of drivers, inputs and other forces without
    a potential. q and qd are what C works on: `sim.q[:] = array` moves the mechanism, copy them to keep them, or take `state`.
    `sim["psi"]` is a coordinate, `sim["rate(psi)"]` its velocity, `sim["tip height"]` an output, `sim["tau"]` an input.
    With a model that has events, steps go through them: `events` lists them, and `stopped` says that one has ended the motion.
    """

    _steps: Steps | None = None

    def __init__(
        self, kernels: Kernels, integrator: str, rtol: float, atol: float | None, inputs: Mapping[str, float], at: Initial
    ) -> None:
        self.kernels, self.integrator = kernels, explicit(integrator)
        from ncgen.mechanism.moving import Moving

        stepping, start = prepared(kernels, self.integrator, rtol, atol, at)
        self._now = Moving(stepping())
        self._alone = Alone(kernels.name)
        self._places = {name: kernels.parameters.index(name) for name in kernels.inputs}
        self._now.t, self.q[:], self.qd[:], self._now.p[:] = at.t, start.q, start.qd, start.p
        self._mechanism = capabilities.checked_compiled(kernels).fingerprint
        self.drive(**inputs)
        if has_events(kernels.model):
            self._steps = through_events(kernels, self.integrator, rtol, atol, self._now, {})

    def __repr__(self) -> str:
        return f"<Simulation {self.kernels.name}: t = {self.t:g} s, {self.integrator}>"

    def __setattr__(self, name: str, value: object) -> None:
        """Members that C works on stay where they are. Raises ModelError with what to write instead."""
        if refused := REPLACED.get(name):
            raise ModelError(f"sim.{name} cannot be replaced: C works on the array it has; write {refused}")
        super().__setattr__(name, value)

    def __copy__(self) -> Simulation:
        raise ModelError(UNCOPIED)

    def __deepcopy__(self, memo: object) -> Simulation:
        raise ModelError(UNCOPIED)

    @property
    def q(self) -> np.ndarray:
        """Position (n,) in m and rad: the array that C works on. After writing to it call `project_state`."""
        return self._now.q

    @property
    def qd(self) -> np.ndarray:
        """Velocities (n,) in m/s and rad/s: the array that C works on."""
        return self._now.qd

    @property
    def t(self) -> float:
        """Return the time.

        Returns
        -------
        float
            Time (s).
        """
        return self._now.t

    @property
    def work(self) -> float:
        """Return the work of drivers, inputs and other forces without a potential.

        Returns
        -------
        float
            Work (J).
        """
        return self._now.work

    @property
    def p(self) -> np.ndarray:
        """Parameters and inputs (n_p,), a copy."""
        return self._now.p.copy()

    @property
    def evaluations(self) -> int:
        """State derivatives of the last step."""
        return self._steps.evaluations if self._steps else self._now.evaluations

    @property
    def impulses(self) -> tuple[Impulse, ...]:
        """What drivers did in the last step where the velocity of one jumped."""
        return self._steps.impulses if self._steps else self._now.impulses

    @property
    def events(self) -> tuple[Happening, ...]:
        """The events since the start, as `run.events` has them; `reset` goes back to those of the state."""
        return self._steps.happened if self._steps else ()

    @property
    def stopped(self) -> bool:
        """True where an event has ended the motion, at the time `t` of the event."""
        return self._steps is not None and self._steps.stopped

    def drive(self, /, **inputs: float) -> Simulation:
        """Set inputs by name; each keeps its value until it is set again.

        Parameters
        ----------
        **inputs : float
            Values by name.

        Returns
        -------
        Simulation
            The simulation itself.

        Raises
        ------
        ModelError
            For an unknown name, or a value that is not a number.
        """
        with self._alone:
            self._drive(inputs)
        return self

    def _drive(self, inputs: dict[str, float]) -> None:
        indices, p = self._places, self._now.p
        if not all(name in indices and isinstance(value, float) for name, value in inputs.items()):
            inputs = {known_name(name, tuple(indices), "step", "input"): finite(x, f"step: {name}") for name, x in inputs.items()}
        for name, value in inputs.items():
            p[indices[name]] = value

    def step(self, h: float, /, **inputs: float) -> Simulation:
        """Advance the motion.

        An event that ends the motion ends the step. After an error the simulation is where it was before.

        Parameters
        ----------
        h : float
            Time to advance (s).
        **inputs : float
            Values of inputs by name; they are constant during the step and afterwards.

        Returns
        -------
        Simulation
            The simulation itself.

        Raises
        ------
        ConvergenceError
            If the motion cannot continue.
        DomainError
            If a kernel returns NaN or infinity.
        ModelError
            If an event has ended the motion before.
        """
        if not isinstance(h, float):
            h = positive(h, "h")
        with self._alone:
            if inputs:
                self._drive(inputs)
            if self._steps:
                if not self._steps.go_on(h):
                    raise ModelError(
                        f"{self.kernels.name}: an event has ended the motion at t = {self.t:.9g} s; go back with sim.reset(state), or "
                        "write other values to sim.q and sim.qd"
                    )
                return self
            status = self._now.go_on(h)
        if status != "ok":
            raise self._refused(status, h)
        return self

    def _refused(self, status: str, h: float) -> Exception:
        positive(h, "h")
        for name in self._places:
            finite(self[name], f"step: {name}")
        now = self._now
        words = f"a step of {h:.6g} s from t = {now.t:.6g} s on does not succeed ({status})"
        error = on_the_way(self.kernels, now.q, now.qd, now.t, now.t + h, now.p)
        return error or ConvergenceError(
            f"{self.kernels.name}: {words}; the mechanism locks there or comes to a singular position, or the step is too long"
        )

    @property
    def state(self) -> SimulationState:
        """Where it is, as a copy."""
        now = self._now
        past = self._steps.past if self._steps else None
        return SimulationState(
            t=now.t,
            q=now.q.copy(),
            qd=now.qd.copy(),
            work=now.work,
            p=now.p.copy(),
            next_step=now.next_step,
            mechanism=self._mechanism,
            past=past,
        )

    def reset(self, state: SimulationState) -> Simulation:
        """Return to a state.

        From there the same steps give the same bits. After an error nothing has changed.

        Parameters
        ----------
        state : SimulationState
            A state that `state` returned.

        Returns
        -------
        Simulation
            The simulation itself.

        Raises
        ------
        ModelError
            For anything but a state of this mechanism, and for numbers that are not finite.
        """
        if not isinstance(state, SimulationState):
            raise ModelError(f"reset: {echo(state)} given; give a state that was kept, such as kept = sim.state")
        if state.mechanism != self._mechanism:
            raise ModelError(f"reset: the state is one of another mechanism than {self.kernels.name}; give a state that this one had")
        now = self._now
        numbers = [finite(getattr(state, name), f"reset: {name}") for name in ("t", "work", "next_step")]
        check_next_step(numbers[2])
        arrays = [array_of(getattr(state, name), getattr(now, name).shape, f"reset: {name}") for name in ("q", "qd", "p")]
        if not np.array_equal(arrays[2], now.p):
            check_parameters(self.kernels, arrays[2])
        if not (self._steps.is_past(state.past) if self._steps else state.past is None):
            raise ModelError(f"reset: past: {echo(state.past)} given; give a state that was kept, such as kept = sim.state")
        with self._alone:
            now.t, now.work, now.next_step = numbers
            now.q[:], now.qd[:], now.p[:] = arrays
            if self._steps and state.past is not None:
                self._steps.go_back(state.past)
        return self

    def project_state(self) -> Simulation:
        """Project q and qd onto the constraints after you wrote to them.

        Returns
        -------
        Simulation
            The simulation itself.

        Raises
        ------
        ConvergenceError
            If the loops cannot be closed; then nothing moves.
        """
        with self._alone:
            status = self._now.project_state()
        if status != "ok":
            problem = f"at t = {self.t:.6g} s the loops do not close ({status})"
            raise ConvergenceError(f"{self.kernels.name}: {problem}; start nearer to a closed position")
        return self

    @property
    def qdd(self) -> np.ndarray:
        """Accelerations (n,) with the present inputs. Raises ConvergenceError where there are none."""
        with self._alone:
            if self._steps:
                return self._steps.accelerations()
            status, qdd = self._now.evaluate(), self._now.qdd.copy()
        if status != "ok":
            raise ConvergenceError(f"{self.kernels.name}: there are no accelerations at t = {self.t:.6g} s ({status})")
        return qdd

    @property
    def outputs(self) -> dict[str, float]:
        """{label: value} of the model's outputs. Warns, once for a mechanism, of loads in them that are not unique."""
        if self._steps:
            self._steps.check_outputs()
        qdd = self.qdd if uses_accelerations(self.kernels.model) else np.zeros_like(self.q)
        values = outputs_at(self.kernels, self.t, self.q, self.qd, qdd, self._now.p)
        return dict(zip(self.kernels.model.outputs, values.tolist(), strict=True))

    def energy(self) -> np.ndarray:
        """Return energies and the power of forces without a potential, with the present inputs.

        Returns
        -------
        numpy.ndarray
            Kinetic and potential energy (J) and power (W), shape (3,).
        """
        return self.kernels.energy(self.q, self.qd, self.t, self._now.p)

    def __getitem__(self, name: str) -> float:
        """A coordinate, rate(…) of one, an output or an input. Raises ModelError for another name."""
        index, name = self.kernels.index, known_text(name)
        if name in index:
            return float(self.q[index[name]])
        if coordinate_of(name) in index:
            return float(self.qd[index[coordinate_of(name)]])
        if name in self._places:
            return float(self._now.p[self._places[name]])
        if name in self.kernels.model.outputs:
            return self.outputs[name]
        raise no_such_quantity(self.kernels, name)
