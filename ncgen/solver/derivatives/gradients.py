"""Exact gradients of motions: `ncgen.gradient` of one state, and of many states in SIMD lanes and threads."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from threading import Lock
from typing import Any, Unpack, overload

import numpy as np

from ncgen.errors import MAX_ECHO, ModelError, shortened
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.argument_checks import ArrayOrNamed, checked_kernels, finite, names_of, refuse_events
from ncgen.solver.batch_rows import WITH_ROWS, has_rows, refuse_batch_options
from ncgen.solver.derivatives.objective import check_objective, of_objective
from ncgen.solver.derivatives.sensitivity import NOT_DIFFERENTIATED, Gradient, gradient_one, instants, is_taped
from ncgen.solver.derivatives.taped_batch import TapedBatch
from ncgen.solver.groups import MotionArguments, OneMotion, takes, without_unused
from ncgen.solver.motions.batch import checked_threads
from ncgen.solver.motions.states import States
from ncgen.solver.runs.progress_reports import ProgressOption, check_progress, reporting


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchGradients:
    """Values (B,) of an objective and its derivatives (B, columns), in the order of `names`: parameters, `z` and `rate(z)` of the
    independent coordinates.

    status (B,): "ok", or a sentence that says why a state has no gradient; its value and derivatives are NaN
    alone (B,): states that had a run of their own, since they come to where the motion in lanes does not do
    """

    values: np.ndarray
    derivatives: np.ndarray
    names: tuple[str, ...]
    status: tuple[str, ...]
    alone: np.ndarray

    def __repr__(self) -> str:
        return f"<BatchGradients by {shortened(', '.join(self.names), MAX_ECHO)}: {int(self.ok.sum())} of {len(self.values)} states>"

    @property
    def ok(self) -> np.ndarray:
        """Which states have a gradient, (B,)."""
        return np.array([status == "ok" for status in self.status])

    def by(self, name: str) -> np.ndarray:
        """Return the derivatives by one name.

        Parameters
        ----------
        name : str
            One of `names`.

        Returns
        -------
        numpy.ndarray
            Derivatives, shape (B,).

        Raises
        ------
        ModelError
            For an unknown name.
        """
        if name not in self.names:
            raise ModelError(f"there is no derivative by {name!r}; there are {shortened(', '.join(self.names), MAX_ECHO)}")
        return self.derivatives[:, self.names.index(name)]


@overload
def gradient(
    kernels: Kernels,
    duration: float,
    steps: int,
    objective: Callable[[np.ndarray, np.ndarray], tuple],
    *,
    by: str | Iterable[str] | None = None,
    threads: None = None,
    progress: ProgressOption = None,
    **arguments: Unpack[OneMotion],
) -> Gradient: ...
@overload
def gradient(
    kernels: Kernels,
    duration: float,
    steps: int,
    objective: Callable[[np.ndarray, np.ndarray], tuple],
    *,
    by: str | Iterable[str] | None = None,
    threads: int | None = None,
    progress: ProgressOption = None,
    **arguments: Unpack[MotionArguments],
) -> Any: ...
@takes(MotionArguments, unused=NOT_DIFFERENTIATED, integrator="rk4", rtol=None)
def gradient(
    kernels: Kernels,
    duration: float,
    steps: int,
    objective: Callable[[np.ndarray, np.ndarray], tuple],
    *,
    by: str | Iterable[str] | None = None,
    threads: int | None = None,
    progress: ProgressOption = None,
    **arguments: Unpack[MotionArguments],
) -> Gradient | BatchGradients:
    """Compute the gradient of a number that depends on a motion by one reverse sweep, or those of many motions.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    duration : float
        Length of the motion in s.
    steps : int
        Number of equal steps, K = steps + 1 times.
    objective : callable
        Function (q, qd), each (K, n), to (value, its derivative by q, its derivative by qd), each (K, n); None is a derivative of zero.
        In a batch it is called once a state, in any order, and not by two threads at a time.
    by : str or iterable of str, optional
        Names of the derivatives. Default: all.
    threads : int, optional
        Number of threads of a batch. Default: one on every processor that this process may use.
    progress : callable or bool, optional
        In a batch called with the fraction of the states that are done; True for a bar. What it raises ends the call, and so does Ctrl-C.
    **arguments : MotionArguments
        The start and the method, as of `sensitivities`. With rows in `q0`, `zd0` or `p`, as of `simulate`, each row is a motion. The
        independent coordinates of a batch are chosen at the first regular state, and are those of all: a derivative by a parameter is
        one at the same start of these. A batch takes neither `qd0` nor `rtol`, `options`, `inputs` and `closing`.

    Returns
    -------
    Gradient or BatchGradients
        The value and its derivatives by name; with rows those of every state. A state of a batch that has none leaves the others as they
        are, and its `status` says why.

    Raises
    ------
    ModelError, ConvergenceError, SingularError
        As `sensitivities`.
    """
    if not has_rows(arguments):
        refuse_batch_options("gradient", threads=threads, progress=progress)
        return gradient_one(kernels, duration, steps, objective, by, **arguments)
    options = without_unused("gradient", arguments, ("rtol", "options", "inputs", "qd0", "closing"), WITH_ROWS)
    return gradient_batch(kernels, duration, steps, objective, by=by, threads=threads, progress=progress, **options)


def gradient_batch(
    kernels: Kernels,
    duration: float,
    steps: int,
    objective: Callable[[np.ndarray, np.ndarray], tuple],
    *,
    by: str | Iterable[str] | None,
    threads: int | None,
    progress: ProgressOption,
    **arguments: Unpack[MotionArguments],
) -> BatchGradients:
    """Compute the gradients of a batch; arguments, results and errors as of `gradient` with rows."""
    checked_kernels(kernels)
    check_objective(objective)
    keywords: dict[str, Any] = {**arguments}
    batch = taped_batch(kernels, duration, steps, threads=threads, **keywords)
    names = batch.names if by is None else names_of(by, "by", batch.names, "parameter or initial value")
    values, one_at_a_time = np.full(len(batch.states.q), np.nan), Lock()

    def weigh(rows: np.ndarray, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        by_q, by_qd = np.empty_like(q), np.empty_like(q)
        with one_at_a_time:
            for k, i in enumerate(rows.tolist()):
                values[i], by_q[k], by_qd[k] = of_objective(objective, q[k], qd[k])
        return by_q, by_qd

    check_progress(progress)
    with reporting(progress, f"gradients of {len(values)} motions of {kernels.name}", 0.0, 1.0) as advance:
        swept = batch.sweep(weigh, advance)
    values[[status != "ok" for status in swept.status]] = np.nan
    derivatives = swept.derivatives if by is None else swept.derivatives[:, [batch.names.index(name) for name in names]]
    return BatchGradients(values=values, derivatives=derivatives, names=names, status=tuple(swept.status), alone=swept.alone)


def taped_batch(
    kernels: Kernels,
    duration: float,
    steps: int,
    integrator: str = "rk4",
    *,
    q0: ArrayOrNamed | None = None,
    zd0: ArrayOrNamed | None = None,
    p: ArrayOrNamed | None = None,
    t0: float = 0.0,
    z: str | Iterable[str] | None = None,
    threads: int | None = None,
) -> TapedBatch:
    """Motions that can be differentiated; arguments and errors as of `gradient` with rows."""
    since_start = instants(checked_kernels(kernels), duration, steps)
    t, names = finite(t0, "t0"), names_of(z, "z", kernels.coordinates)
    refuse_events(kernels.model, "gradient of rows")
    is_taped(kernels, integrator)
    states = States.of(kernels, None, assembled=True, q0=q0, zd0=zd0, p=p, t0=t, z=names)
    return TapedBatch(
        kernels=kernels, states=states, times=t + since_start, method=integrator, follows=q0 is None, threads=checked_threads(threads)
    )
