"""A motion that is advanced step by step, driven from outside: by a controller, in a game, next to another simulation.

    sim = ncgen.start(kernels)
    for k in range(1000):
        sim.step(1e-3, tau=controller(sim["psi"], sim["rate(psi)"]))

A step is one call of C. It finds out nothing about the mechanism that is not known when the simulation starts.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from ncgen.errors import ConvergenceError, ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.methods.table import AUTO, INTEGRATORS, find_integrator
from ncgen.model.elements import coordinate_of
from ncgen.solver.engines import compiled
from ncgen.solver.finite import on_the_way
from ncgen.solver.formalisms.impulse import Impulse, cross
from ncgen.solver.given import array_of, checked_kernels, echo, finite, has_events, known_name, offer, positive, values_by_name
from ncgen.solver.groups import DEFAULTS, MotionArguments, StartArguments, takes
from ncgen.solver.motions.alone import Alone
from ncgen.solver.parameter_checks import check_parameters
from ncgen.solver.positions.massless import check_mass
from ncgen.solver.positions.rank import rank_at
from ncgen.solver.runs.choice import ALL, EXPLICIT
from ncgen.solver.runs.run import Initial, relative_tolerance
from ncgen.solver.runs.start import Start, begin
from ncgen.solver.runs.tolerances import NEAR_ZERO, Tolerances
from ncgen.solver.trajectories.output_values import outputs_of, uses_accelerations, uses_loads

if TYPE_CHECKING:
    from ncgen.mechanism.moving import Moving, MovingRow, Stepping
    from ncgen.solver.events.steps import Past, Steps
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

NOT_STEPPED = ("formalism", "engine", "number", "options", "max_step")
"""Arguments of a method that make no difference where a simulation is moved step by step."""

UNCOPIED = "a simulation is not copied: C works on its memory; start another one with ncgen.start and reset it to sim.state"


@dataclass(frozen=True, eq=False)
class SimulationState:
    """A simulation at an instant: all that `reset` needs to go back to it.

    t: s; q, qd (n,): m and rad, and per second; work: J; p (n_p,): parameters and inputs; next_step: s, of error control, 0 where it has
    to find one; mechanism: the fingerprint of its code, so that it is not taken for a state of another one; past: of a model with events,
    those so far and what is held
    """

    t: float
    q: np.ndarray
    qd: np.ndarray
    work: float
    p: np.ndarray
    next_step: float
    mechanism: str
    past: Past | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        return f"<SimulationState of {len(self.q)} coordinates at t = {self.t:g} s>"


@takes(MotionArguments, unused=NOT_STEPPED)
def start(kernels: Kernels, **arguments: Unpack[MotionArguments]) -> Simulation:
    """Start a simulation that waits for its first step.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    **arguments : MotionArguments
        The start and the method. `inputs` are numbers, {name: value}; each keeps its value until a step gives it another. `integrator`
        is an explicit one in C: "auto" takes as many steps within a step as `rtol` asks for; with rk4 a step is one of this method, so
        that its cost is always the same. `rtol` and `atol` are tolerances of every step.

    Returns
    -------
    Simulation
        The mechanism at `t0`.

    Raises
    ------
    ModelError
        For invalid arguments, and where C alone cannot move the mechanism.
    ConvergenceError, SingularError
        As `simulate` does for a start.
    """
    return Simulation(checked_kernels(kernels).driven_by(None), *stepped(kernels, arguments))


def stepped(kernels: Kernels, arguments: MotionArguments) -> tuple[str, float, float | None, dict[str, Any], Initial]:
    """Return integrator, tolerances, inputs and start of a simulation that is moved step by step. Raises ModelError."""
    options = {**DEFAULTS, **arguments}
    method = options["integrator"], relative_tolerance(options["rtol"]), options["atol"]
    at = Initial.from_arguments(kernels, **{name: options[name] for name in StartArguments.__annotations__ if name != "inputs"})
    return *method, values_by_name(options["inputs"], "inputs"), at


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
        self._mechanism = compiled.checked_compiled(kernels).fingerprint
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
        places, p = self._places, self._now.p
        if not all(name in places and isinstance(value, float) for name, value in inputs.items()):
            inputs = {known_name(name, tuple(places), "step", "input"): finite(x, f"step: {name}") for name, x in inputs.items()}
        for name, value in inputs.items():
            p[places[name]] = value

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
        return SimulationState(now.t, now.q.copy(), now.qd.copy(), now.work, now.p.copy(), now.next_step, self._mechanism, past)

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


def no_such_quantity(kernels: Kernels, name: str) -> ModelError:
    """Return the error about a name that a simulation does not know."""
    return ModelError(f"{kernels.name} has no coordinate, rate, input or output {name!r}; {offer(name, tuple(kernels.index))}")


def check_next_step(least: float) -> None:
    """Raise ModelError for a step (s) of error control that is negative."""
    if least < 0:
        raise ModelError(f"reset: next_step is {least:g} s; it must be positive, or 0 for a step that is found")


def prepared(kernels: Kernels, integrator: str, rtol: float, atol: float | None, at: Initial) -> tuple[Callable[[], Stepping], Start]:
    """What makes a way to step, one for every thread, and where motions start. Raises ModelError where C cannot move the mechanism."""
    method = Method.of(ALL, integrator)
    compiled.checked_compiled(kernels)
    by_python = "the model calls a Python function" if kernels.model.callbacks else None
    if kernels.model.branches:
        by_python = "the paper's sine-or-cosine rows choose anew between steps"
    if refused := by_python or compiled.refusal(kernels, method, "c", "double"):
        raise ModelError(f"{kernels.name} cannot be stepped: {refused}; use ncgen.simulate")
    kernels = compiled.checked_compiled(kernels)
    form = compiled.form_of(kernels, method)
    start = begin(kernels, at, partitioned=False)
    check_mass(kernels, start.q, at.t, start.p)
    rank, _ = rank_at(kernels, start.q, at.t, start.p)
    least = absolute(rtol, atol)
    sizes = Tolerances(rtol, least, atol is None, 0.0).in_c(kernels.column_sizes, kernels.column_sizes)["sizes"]
    from ncgen.mechanism.moving import Stepping

    dynamics = compiled.all_coordinates(kernels, form=form)
    return lambda: Stepping(dynamics, integrator, rank, rtol, least, sizes, compiled.closeness("double"), cross), start


def outputs_at(kernels: Kernels, t: float, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, p: np.ndarray) -> np.ndarray:
    """All outputs (outputs,) of a state at t (s) with its accelerations."""
    lam = np.zeros(kernels.m)
    if uses_loads(kernels.model):
        from ncgen.solver.loads.observed_loads import multipliers_at

        lam = multipliers_at(kernels, t, q, qd, p)
    return outputs_of(kernels, [t], q[None], qd[None], p, (qdd[None], lam[None]))[0]


def known_text(name: object) -> str:
    """A text, as names are. Raises ModelError for anything else."""
    if not isinstance(name, str):
        raise ModelError(f"{echo(name)} is no name; give that of a coordinate, a rate, an input or an output")
    return name


def through_events(
    kernels: Kernels, integrator: str, rtol: float, atol: float | None, now: Moving | MovingRow, modes: dict[Hashable, Stepping]
) -> Steps:
    """What carries a mechanism over its events; modes: as of `Steps`. Raises what a start with events raises."""
    from ncgen.solver.events.steps import Steps

    return Steps(kernels, Method.of(ALL, integrator), Tolerances(rtol, absolute(rtol, atol), atol is None, 0.0), now, modes)


def absolute(rtol: float, atol: float | None) -> float:
    """The absolute tolerance, in natural sizes where it is not given. Raises ModelError for one that is not positive."""
    return NEAR_ZERO * rtol if atol is None else positive(atol, "atol")


def explicit(integrator: str) -> str:
    """The name of an explicit integrator in C. Raises ModelError for another one."""
    if isinstance(integrator, str) and integrator == AUTO:
        return EXPLICIT
    entry = find_integrator(integrator)
    if not (entry.in_c and entry.tableau):
        known = ", ".join(name for name, each in INTEGRATORS.items() if each.in_c and each.tableau)
        raise ModelError(f"integrator {entry.name} cannot be stepped from outside; choose one of {known}")
    return entry.name
