"""The fast path: a simulation as one call of the C runtime, where a mechanism allows it."""

from __future__ import annotations

import hashlib
from functools import cache, partial
from typing import TYPE_CHECKING, Any, Literal, TypeGuard, overload

import numpy as np

from ncgen.errors import ConvergenceError, ModelError, NcgenError, SingularError
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.reactive import ReactiveForce
from ncgen.methods.method import Method
from ncgen.methods.newmark import newmark
from ncgen.methods.table import AUTO, FORMALISMS, INTEGRATORS, in_c, number_in_c
from ncgen.program.algebra.elimination import EliminationError
from ncgen.program.programs import Split
from ncgen.program.tree.table_layout import tables_of
from ncgen.solver.finite import on_the_way
from ncgen.solver.formalisms.projection import least_energy
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.branches import refresh_branches, rule_of
from ncgen.solver.positions.open_tree import open_tree
from ncgen.solver.positions.partition import (
    MIN_GAIN,
    Partition,
    Partitions,
    choose_partitions,
    determined,
    other_partitions,
    quality,
    stuck_message,
)
from ncgen.solver.positions.position import TOLERANCE, newton_position
from ncgen.solver.positions.rank import REMEMBERED, closeness_at, trial_positions
from ncgen.solver.runs.divergence import unsolved_step
from ncgen.solver.runs.path import Path
from ncgen.solver.runs.run import EMITTED, Form, Partitioned
from ncgen.solver.runs.task import Task
from ncgen.solver.runs.tolerances import Tolerances
from ncgen.symbolic.tree import spanning_tree

if TYPE_CHECKING:
    from ncgen.mechanism.batch_runs import LaneDynamics
    from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
    from ncgen.mechanism.library import CompiledKernels
    from ncgen.mechanism.motion_sources import Seen
    from ncgen.mechanism.runtime import DenseDynamics, EmittedDynamics, Outcome
    from ncgen.program.ir.sampling import Sample

MOST_RATES = 60
"""Rates of a tree of bodies up to which a recursion is written out where nobody asked for it: it is compiled in some seconds."""

FEW_RATES = 20
"""The same of a tree that moves in loops over tables, too, at two to three times the cost: an arm of 20 takes 10,000 operations, which are
assembled and compiled in 2 s."""

N_PERTURBED_SAMPLES = 3
"""How many sample positions have other parameters and times."""

SAMPLE_PERTURBATION = 0.03
"""By which share of theirs, and of a second."""

GROWTH = 2.0
"""Other independent coordinates are looked for when ‖R‖² has grown by this factor: error control sees the independent
coordinates only, and R is what their errors are multiplied by."""

REUSE = 0.7
"""A choice of independent coordinates made earlier in the run is taken again if its quality is this share of the best."""

STIFFNESS_REASON = "the mechanism is stiff"
"""The reason of a run that was to end where an implicit integrator would serve better: the path goes on with that."""

FINAL = ("short", "not converged")
"""Statuses of a run that Python's engine, which has the same method, would not carry farther."""

MOST_EMITTED = 6
"""How many choices of independent coordinates are emitted and compiled in one run before the dense path takes over."""


def refusal(kernels: Kernels, method: Method, engine: str, number: str) -> str | None:
    """Why a simulation cannot run in C, as far as its method and the mechanism tell, in words, or None if it can.

    engine: as of `simulate`; number: C's type
    """
    from ncgen.mechanism.library import CompiledKernels
    from ncgen.mechanism.properties import uses_tangents
    from ncgen.mechanism.runtime_library import has_runtime, part_for

    name = method.integrator.name
    if not isinstance(kernels, CompiledKernels) and (engine in EMITTED or number != "double" or not has_runtime(part_for(name))):
        return f"the kernels are {kernels.backend}, not compiled"
    if not method.integrator.in_c:
        return f"{name} runs in Python; in C there are {', '.join(in_c(INTEGRATORS))}"
    if not method.formalism.in_c:
        return f"{method.formalism.name} runs in Python; in C there are {', '.join(in_c(FORMALISMS))}"
    if engine in EMITTED and method.is_constrained:
        return f"a state derivative is emitted for coordinate-partitioning, not for {method.formalism.name}"
    if kernels.model.callbacks and number != "double":
        return f"the model calls a Python function, which computes with doubles, not {number}"
    if kernels.model.callbacks and engine in EMITTED:
        return "the model calls a Python function, whose forces are not in what is written out"
    if kernels.model.branches and (engine in EMITTED or number != "double"):
        return "the paper's sine-or-cosine rows choose anew between steps, in doubles and in C that is the same for all mechanisms"
    if number != "double" and uses_tangents(kernels, name):
        return f"{name} takes derivatives of the kernels, which are double"
    return None


def refusal_of_size(kernels: Kernels, partitions: Partitions, engine: str) -> str | None:
    """Why a state derivative cannot be emitted for a choice of independent coordinates, in words, or None if it can."""
    from ncgen.program.programs import MAX_ELIMINATED_DOF

    if engine in EMITTED and partitions.position is not partitions.velocity:
        return "a state derivative is emitted for one choice of independent coordinates; rolling conditions need two"
    if engine in EMITTED and len(partitions.position.independent) > MAX_ELIMINATED_DOF and not spanning_tree(kernels.model).links:
        return f"without a tree of bodies a state derivative is emitted for up to {MAX_ELIMINATED_DOF} degrees of freedom"
    return None


def is_emitted(kernels: Kernels, partitions: Partitions) -> TypeGuard[CompiledKernels]:
    """True where the state derivative of a choice of independent coordinates can be emitted and run in C."""
    method = Method.of("coordinate-partitioning", "dopri5")
    return (refusal(kernels, method, "emitted", "double") or refusal_of_size(kernels, partitions, "emitted")) is None


def checked_compiled(kernels: Kernels) -> CompiledKernels:
    """The kernels themselves, where `refusal` has nothing against them. Raises ModelError for those that are not compiled."""
    from ncgen.mechanism.library import CompiledKernels

    if not isinstance(kernels, CompiledKernels):
        raise ModelError(f"{kernels.name}: the kernels are {kernels.backend}, not compiled; compile the model with backend='c'")
    return kernels


def all_coordinates(kernels: Kernels, number: str = "double", form: Form = "dense", integrator: str = AUTO) -> ConstrainedDynamics:
    """The state derivative over all coordinates, made once for every kernels object, number type and form.

    form: "emitted" for accelerations that are emitted, seen in positions around the model's own start, so that they are the same in
        every run; "tree" for those in loops over tables of an open tree; else of the factored matrix
    integrator: for which the runtime is compiled at the same time
    """
    from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
    from ncgen.mechanism.runtime_library import part_for

    def made() -> ConstrainedDynamics:
        samples_of = partial(own_positions, kernels, 0) if form == "emitted" and _has_few_rates(kernels, least=0) else None
        tree = open_tree(kernels) if form == "tree" else None
        part = part_for(integrator, "emitted" if samples_of else "tree" if tree else None)
        return ConstrainedDynamics(kernels, number, samples_of, tables_of(tree) if tree else None, part)

    return kernels.remember("constrained dynamics", (number, form), made)


def form_of(kernels: Kernels, method: Method) -> Form:
    """What accelerations a run over all coordinates takes where nobody says: of a recursion over the tree of bodies that is emitted
    and compiled, or in loops over tables, or of the factored matrix."""
    if _may_recur(kernels, method) and not _has_few_rates(kernels, FEW_RATES) and open_tree(kernels):
        return "tree"
    if _is_recursive(kernels, method):
        return "emitted"
    return "tree" if _may_recur(kernels, method) and open_tree(kernels) else "dense"


def _may_recur(kernels: Kernels, method: Method) -> bool:
    """True where a recursion could give the accelerations of a method."""
    if (
        kernels.model.branches
        or refusal(kernels, method, "c", "double")
        or not (method.formalism.name == "lagrange" and method.integrator.takes_recursion)
    ):
        return False
    return method.options.get("stabilisation") == "projection"


def is_written_out(kernels: Kernels, method: Method, least: int = 1) -> bool:
    """True where a run over all coordinates takes its accelerations from a recursion that is emitted and compiled, with all forces.

    least: rates of the tree of bodies; with 0 of them, as of points alone, a run takes others, but there is such a recursion
    """
    callbacks = kernels.model.callbacks
    return (not callbacks or ReactiveForce.only(callbacks) is not None) and _is_recursive(kernels, method, least)


def _is_recursive(kernels: Kernels, method: Method, least: int = 1) -> bool:
    from ncgen.mechanism.library import CompiledKernels

    if not isinstance(kernels, CompiledKernels) or not _has_few_rates(kernels, least=least):
        return False
    return _may_recur(kernels, method) and all_coordinates(kernels, form="emitted", integrator=method.integrator.name).is_emitted


def _has_few_rates(kernels: Kernels, most: int | None = None, least: int = 1) -> bool:
    """True for a tree of bodies that can be emitted: without compiling for long, unless the kernels are to be of the most effort.

    least, most: rates (default: MOST_RATES)
    """
    freedoms = kernels.remember("freedoms of the tree", (), lambda: spanning_tree(kernels.model).dof)
    return least <= freedoms and (kernels.effort == "most" or freedoms <= (MOST_RATES if most is None else most))


def own_positions(kernels: Kernels, least: int = 1) -> Seen | None:
    """Independent coordinates of the positions at a model's own start, and `samples` around it; None where there are none, or less than the
    least rates."""
    if not _has_few_rates(kernels, least=least):
        return None
    try:
        q = assemble(kernels, kernels.q0)
        return split_of(choose_partitions(kernels, q).position), samples(kernels, q, kernels.p0)
    except NcgenError:
        return None


def run_constrained(path: Path, kernels: Kernels, task: Task, form: Form = "dense") -> str | None:
    """Complete a path over a time grid with a formalism over all coordinates, from its last row on if it has any.

    form: of the accelerations
    Returns None, or why the run had to stop before the end of the grid: STIFFNESS_REASON where it was to end so. Raises DomainError where a
    term is not a number, ConvergenceError where steps become too short.
    """
    from ncgen.mechanism.listening import Progress

    method, grid, number, p = task.method, task.grid, task.number, task.p
    dynamics = all_coordinates(kernels, number, form, method.integrator.name)
    q, qd, work = task.q, task.velocities, 0.0
    if dynamics.singular_mass and not dynamics.is_emitted and not task.first_step:
        # C regularises what has no inertia; here a motion that has none, and nothing to hold it, is refused by name. What goes on with
        # the step of a part before it has been checked.
        key = q.tobytes(), float(grid[0]), p.tobytes()
        kernels.remember("inertia of all motions", key, lambda: bool(least_energy(kernels, q, float(grid[0]), p)), REMEMBERED)
    settings = method.options
    in_c = settings_in_c(settings)
    if len(path.q):
        q, qd, work = path.take_last()
    begun = len(path.q)
    times = grid[begun:]
    done = dynamics.simulate(
        method.integrator.name, times, q, qd, p, tolerance=closeness(number), formalism=number_in_c(method.formalism),
        **in_c,
        rank=task.rank_at(kernels, q, times[0]), conditions=task.watched, max_step=task.step_in_c,
        progress=Progress(task.progress, kernels.name, task.arrival), choose=rule_of(kernels),
        movable=task.movable_from(begun), stop_when_stiff=int(task.stop_when_stiff), inputs=task.driven, breaks=task.breaks,
        first_step=task.first_step, **_weights(settings), **task.tolerances.in_c(kernels.column_sizes, kernels.column_sizes),
    )  # fmt: skip
    task.looked_at(begun, done.t)
    path.extend(done.q, done.qd, done.work + work, (done.steps, done.evaluations, done.newton_steps, 0, done.repeated))
    path.jacobians += done.jacobians
    path.fallbacks += done.fallbacks
    path.stiff += done.stiff
    path.projections += done.steps if in_c["project"] else 0
    path.largest_projection = max(path.largest_projection, done.largest_projection)
    path.crossed, path.next_step = done.crossed, done.next_step
    if done.stopped:
        path.stop(done.reached, done.last[0], done.last[1], work + done.last[2])
    reason = _ended(path, kernels, grid, done, work, p)
    if done.status in FINAL and task.step:
        path.break_off(grid, done.reached, done.last[0], done.last[1], work + done.last[2])
        raise ConvergenceError(unsolved_step(kernels.name, done.reached, task.step))
    if done.status in FINAL and form != "dense" and method.integrator.tangents == "unless_recursive":
        return _by_the_matrix(path, kernels, task)
    if done.status in FINAL:
        raise ConvergenceError(
            f"{kernels.name}: the motion cannot go on beyond t = {done.reached:.6g} s, where steps become too short; the mechanism comes "
            "to a singular position there, or rtol asks for less than rounding leaves"
        )
    return reason


def settings_in_c(settings: dict[str, Any]) -> dict[str, float]:
    """The options of a formalism over all coordinates, or of energy-momentum or ali3p, by the names of `ncgen_options`."""
    stabilisation = settings.get("stabilisation")
    projected = stabilisation == "projection" or settings.get("project_velocities", False)
    frequency = settings["omega"] if stabilisation == "baumgarte" else 0.0
    return {"project": int(projected), "penalty": settings.get("alpha", 0.0), "damping": settings.get("xi", 0.0), "frequency": frequency}


def _by_the_matrix(path: Path, kernels: Kernels, task: Task) -> str | None:
    """The rest of a run whose Newton steps in the degrees of freedom do not converge; its evaluations count as those that fall back."""
    before = path.evaluations
    reason = run_constrained(path, kernels, task)
    path.fallbacks += path.evaluations - before
    return reason


def _ended(path: Path, kernels: Kernels, grid: np.ndarray, done: Outcome, work: float, p: np.ndarray) -> str | None:
    """None for a run that came to its end, or why it did not; DomainError, or what it was ended by, with all that it reached.

    work: done before this run, which its own is added to
    """
    if done.status == "ok":
        return None
    q, qd, own = done.last
    if done.status == "stiff":
        return STIFFNESS_REASON
    problem = None if done.status in ("interrupted", "pivot") else on_the_way(kernels, q, qd, done.reached, done.tried, p)
    if problem or done.status == "interrupted":
        path.break_off(grid, done.reached, q, qd, work + own)
        raise problem or done.raised or KeyboardInterrupt()
    return f"the run in C stopped at t = {done.reached:.6g} s ({done.status})"


def _weights(settings: dict[str, Any]) -> dict[str, float]:
    """Of generalised-α, by the names of `ncgen_options`."""
    if "rho" not in settings:
        return {}
    return dict(zip(("alpha_m", "alpha_f"), newmark(settings["rho"], settings["hht"]), strict=False))


@cache
def rounding(number: str) -> float:
    """The relative rounding of a number type."""
    from ncgen.toolchain.abi import NUMBERS

    return float(np.finfo(NUMBERS[number].dtype).eps)


def closeness(number: str) -> float:
    """`TOLERANCE` of positions for the digits of a number type."""
    return TOLERANCE * rounding(number) / rounding("double")


@overload
def dynamics(
    kernels: Kernels, partitions: Partitions, form: Literal["lanes"], q: np.ndarray, p: np.ndarray, number: str = "double"
) -> LaneDynamics: ...


@overload
def dynamics(
    kernels: Kernels, partitions: Partitions, form: Literal["dense"], q: np.ndarray, p: np.ndarray, number: str = "double"
) -> DenseDynamics: ...


@overload
def dynamics(
    kernels: Kernels,
    partitions: Partitions,
    form: Literal["emitted", "refined"],
    q: np.ndarray,
    p: np.ndarray,
    number: str = "double",
) -> EmittedDynamics: ...


def dynamics(
    kernels: Kernels, partitions: Partitions, form: str, q: np.ndarray, p: np.ndarray, number: str = "double"
) -> LaneDynamics | DenseDynamics | EmittedDynamics:
    """The state derivative for a partition, made once for every kernels object, partition, form and number type.

    form: "dense", "emitted", "refined" (emitted, with iterative refinement), or "lanes" for many states at a time (double only)
    q (n,), p (n_p,): a typical position (m, rad) and parameters, with which the order of an emitted elimination is chosen
    """
    split, positions = split_of(partitions.velocity), split_of(partitions.position)
    apart = None if partitions.position is partitions.velocity else positions
    key = split, positions, form, number
    return kernels.remember("dynamics", key, lambda: _made(kernels, split, apart, form, number, q, p))


def _made(
    kernels: Kernels, split: Split, positions: Split | None, form: str, number: str, q: np.ndarray, p: np.ndarray
) -> LaneDynamics | DenseDynamics | EmittedDynamics:
    """A state derivative; positions: the choice for them where it is another than for velocities."""
    from ncgen.mechanism.batch_runs import LaneDynamics
    from ncgen.mechanism.motion_sources import Written
    from ncgen.mechanism.runtime import DenseDynamics, EmittedDynamics

    if form == "dense":
        return DenseDynamics(kernels, split, number, positions)
    kernels = checked_compiled(kernels)
    around = hashlib.sha256(np.concatenate([q, p]).tobytes()).hexdigest()
    written = Written(
        kernels=kernels, split=split, samples_of=partial(samples, kernels, q.copy(), p.copy()), around=around, refine=form == "refined"
    )
    try:
        return LaneDynamics(written) if form == "lanes" else EmittedDynamics(written, number)
    except EliminationError as error:
        raise ModelError(
            f"{kernels.name}: no order of elimination can be emitted for these coordinates: {error}; use engine='c'"
        ) from error


def split_of(part: Partition) -> Split:
    """A choice of independent coordinates as numbers."""
    return Split(*(tuple(a.tolist()) for a in (part.rows, part.dependent, part.independent)))


def samples(kernels: Kernels, q: np.ndarray, p: np.ndarray) -> list[Sample]:
    """Typical positions around q, from which the order of elimination is chosen, and seen what vanishes: with other parameters, too,
    and at other times, so that nothing is taken for 0 that is 0 only now."""
    from ncgen.program.ir.sampling import Sample

    typical = [Sample(0.0, x, p) for x in trial_positions(kernels, q, 0.0, p)]
    generator = np.random.default_rng(1)
    for _ in range(N_PERTURBED_SAMPLES if kernels.parameters or np.any(kernels.nu(q, 0.0, p)) else 0):
        other = p + SAMPLE_PERTURBATION * generator.uniform(-1, 1, len(p)) * np.where(p == 0.0, 1.0, np.abs(p))
        t = float(SAMPLE_PERTURBATION * generator.uniform())
        try:
            released, free = refresh_branches(kernels, q, other), np.arange(kernels.n)
            close = newton_position(kernels, typical[-1].q, t, released, free, closeness_at(kernels, q))
            typical.append(Sample(t, close.q, other))
        except NcgenError:
            continue  # these parameters leave no position
    return typical


def run(path: Path, kernels: Kernels, task: Task, form: Partitioned) -> str | None:
    """Complete a path over a time grid, from its last row on if it has any, to its end or to a `Stop`; where the independent
    coordinates become bad, go on with others.

    form: of the state derivative
    Returns None, or why the run had to stop before the end of the grid: STIFFNESS_REASON where it was to end so. Raises DomainError where a
    term is not a number, ConvergenceError where steps become too short.
    """
    from ncgen.mechanism.listening import Progress

    method, number, p, partitions = task.method, task.number, task.p, determined(path.partitions)
    used_partitions = [partitions]
    grid, growth, begun = np.asarray(task.grid, dtype=float), GROWTH, len(path.q) > 0
    q, qd, zd, work = task.q, np.zeros(kernels.n), task.velocities, 0.0
    if begun:
        q, qd, work = path.take_last()
        zd = qd[partitions.velocity.independent]
    times, movable = grid[len(path.q) :], task.movable_from(len(path.q))
    t, progress = float(times[0]), Progress(task.progress, kernels.name, task.arrival)
    try:
        while True:
            progress(t)
            dynamics = _for_next(kernels, partitions, form, len(used_partitions), q, p, number)
            done = dynamics.simulate(
                method.integrator.name, times, q, zd, p, max_step=task.step_in_c, conditions=task.watched, tolerance=closeness(number),
                max_growth=growth, progress=progress, movable=movable, stop_when_stiff=int(task.stop_when_stiff), inputs=task.driven,
                breaks=task.breaks, choose=rule_of(kernels), **_in_c(task.tolerances, kernels, partitions),
            )  # fmt: skip
            fresh = 0 if times[0] == grid[len(path.q)] else 1  # a first row off the grid is only where the last run stopped
            counts = (done.steps, done.evaluations, done.newton_steps, 0, done.repeated)
            task.looked_at(len(path.q), done.t[fresh:])
            path.extend(done.q[fresh:], done.qd[fresh:], done.work[fresh:] + work, counts)
            path.jacobians += done.jacobians
            path.fallbacks += done.fallbacks
            path.stiff += done.stiff
            if done.stopped:
                path.stop(done.reached, done.last[0], done.last[1], work + done.last[2])
            if done.stopped or done.status == "ok" or len(path.q) == len(grid):
                return None
            lost = grid[len(path.q)] < done.reached  # rows inside a step that was taken
            reason = _ended(path, kernels, grid, done, work, p)
            if reason == STIFFNESS_REASON or lost:
                return reason
            advanced, p = done.reached > t, refresh_branches(kernels, done.last[0], p)
            t, q, qd, work, begun = done.reached, done.last[0], done.last[1], work + done.last[2], True
            before, partitions = partitions, _better(kernels, partitions, used_partitions, q, t, p)
            path.partitions, changed = partitions, partitions is not before
            if not (advanced or changed) and done.status in FINAL:
                raise ConvergenceError(stuck_message(kernels, t, task.step))
            if not (advanced or changed):
                return reason
            path.counts[3] += changed
            growth = GROWTH if changed else GROWTH * growth  # nothing better here: look again when it is worse
            zd = qd[partitions.velocity.independent]
            left = np.asarray(grid[len(path.q) :])
            times = np.concatenate([[t], left[left > t]])
            movable = np.append(False, task.movable_from(len(path.q))[left > t])
    except BaseException:
        if path.stopped is None and (len(path.q) or begun):  # else it had not begun
            path.break_off(grid, t, q, qd, work)
        raise


def _for_next(
    kernels: Kernels, partitions: Partitions, form: Partitioned, number_of_choices: int, q: np.ndarray, p: np.ndarray, number: str
) -> DenseDynamics | EmittedDynamics:
    """The state derivative of the choice that a run continues with: dense after many, or where a later one has no order to be emitted."""
    if number_of_choices <= MOST_EMITTED:
        try:
            return dynamics(kernels, partitions, form, q, p, number)
        except ModelError:
            if number_of_choices == 1:  # it was asked for
                raise
    return dynamics(kernels, partitions, "dense", q, p, number)


def _in_c(tolerances: Tolerances, kernels: Kernels, partitions: Partitions) -> dict[str, Any]:
    """Arguments of a run on independent coordinates."""
    return tolerances.in_c(*(kernels.column_sizes[part.independent] for part in (partitions.velocity, partitions.position)))


def _better(
    kernels: Kernels, partitions: Partitions, used_partitions: list[Partitions], q: np.ndarray, t: float, p: np.ndarray
) -> Partitions:
    """The best partition at q if it is clearly better than the present one; one used before in this run if it will do."""
    try:
        best = other_partitions(kernels, partitions, q, t, p)
    except SingularError:
        return partitions

    def worth(x: Partitions) -> float:
        return min(quality(kernels, part, q, t, p) for part in {x.velocity, x.position})

    possible = worth(best)
    if possible < MIN_GAIN * worth(partitions):
        return partitions
    known = max(used_partitions, key=worth)
    if worth(known) >= REUSE * possible:
        return known
    used_partitions.append(best)
    return best
