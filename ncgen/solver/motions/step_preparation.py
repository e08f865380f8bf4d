"""What simulations that are advanced step by step share, one or many: their arguments, what moves them, and quantities by name."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.methods.table import AUTO, INTEGRATORS, find_integrator
from ncgen.solver.argument_checks import echo, offer, positive, values_by_name
from ncgen.solver.engines import acceleration_forms, capabilities
from ncgen.solver.formalisms.impulse import cross
from ncgen.solver.groups import DEFAULTS, MotionArguments, StartArguments
from ncgen.solver.positions.massless import check_mass
from ncgen.solver.positions.rank import rank_at
from ncgen.solver.runs.choice import ALL, EXPLICIT
from ncgen.solver.runs.run import Initial
from ncgen.solver.runs.settings import relative_tolerance
from ncgen.solver.runs.start import Start, begin
from ncgen.solver.runs.tolerances import NEAR_ZERO, Tolerances
from ncgen.solver.trajectories.output_values import outputs_of, uses_loads

if TYPE_CHECKING:
    from ncgen.mechanism.moving import Moving, MovingRow, Stepping
    from ncgen.solver.events.steps import Steps


def stepped(kernels: Kernels, arguments: MotionArguments) -> tuple[str, float, float | None, dict[str, Any], Initial]:
    """Return integrator, tolerances, inputs and start of a simulation that is moved step by step. Raises ModelError."""
    options = {**DEFAULTS, **arguments}
    method = options["integrator"], relative_tolerance(options["rtol"]), options["atol"]
    at = Initial.from_arguments(kernels, **{name: options[name] for name in StartArguments.__annotations__ if name != "inputs"})
    return *method, values_by_name(options["inputs"], "inputs"), at


def prepared(kernels: Kernels, integrator: str, rtol: float, atol: float | None, at: Initial) -> tuple[Callable[[], Stepping], Start]:
    """What makes a way to step, one for every thread, and where motions start. Raises ModelError where C cannot move the mechanism."""
    method = Method.of(ALL, integrator)
    capabilities.checked_compiled(kernels)
    by_python = "the model calls a Python function" if kernels.model.callbacks else None
    if kernels.model.branches:
        by_python = "the paper's sine-or-cosine constraints change between steps"
    if refused := by_python or capabilities.refusal(kernels, method, "c", "double"):
        raise ModelError(f"{kernels.name} cannot be stepped: {refused}; use ncgen.simulate")
    kernels = capabilities.checked_compiled(kernels)
    form = acceleration_forms.form_of(kernels, method)
    start = begin(kernels, at, partitioned=False)
    check_mass(kernels, start.q, at.t, start.p)
    rank, _ = rank_at(kernels, start.q, at.t, start.p)
    least = absolute(rtol, atol)
    sizes = Tolerances(rtol, least, atol is None, 0.0).in_c(kernels.column_sizes, kernels.column_sizes)["sizes"]
    from ncgen.mechanism.moving import Stepping

    dynamics = acceleration_forms.all_coordinates(kernels, form=form)
    return lambda: Stepping(dynamics, integrator, rank, rtol, least, sizes, capabilities.closeness("double"), cross), start


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


def no_such_quantity(kernels: Kernels, name: str) -> ModelError:
    """Return the error about a name that a simulation does not know."""
    return ModelError(f"{kernels.name} has no coordinate, rate, input or output {name!r}; {offer(name, tuple(kernels.index))}")


def check_next_step(least: float) -> None:
    """Raise ModelError for a step (s) of error control that is negative."""
    if least < 0:
        raise ModelError(f"reset: next_step is {least:g} s; it must be positive, or 0 for a step that is found")


def chosen_rows(rows: ArrayLike | None, size: int, name: str) -> np.ndarray:
    """Numbers of rows, from numbers, a mask or None for all of `size` simulations. Raises ModelError for other ones."""
    if rows is None:
        return np.arange(size)
    try:
        array = np.atleast_1d(rows)
    except ValueError:  # lists of different lengths
        array = np.empty(1)
    if array.dtype == bool and array.shape == (size,):
        return np.flatnonzero(array)
    if not array.size:
        return np.arange(0)
    whole = array.ndim == 1 and np.issubdtype(array.dtype, np.integer)
    if not (whole and array.min() >= 0 and array.max() < size):
        raise ModelError(f"rows: {name} has simulations 0 to {size - 1}; give their numbers, or a mask ({size},)")
    return array
