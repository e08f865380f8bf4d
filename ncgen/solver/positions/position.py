"""The position problem: coordinates that satisfy Φ(q, t) = 0.

Newton's method with the minimum-norm step, halved where it does not help; redundant rows do no harm.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ConvergenceError, DeadCentreError, ModelError, counted
from ncgen.mechanism.kernels import Kernels
from ncgen.model.singular_values import least_squares
from ncgen.solver import argument_checks
from ncgen.solver.argument_checks import ArrayOrNamed
from ncgen.solver.finite import check_instant, is_finite, watched
from ncgen.solver.geometry import angles, measured_angles
from ncgen.solver.positions.dead_centres import approached, is_dead_centre
from ncgen.solver.positions.sparse_rows import DENSE, least_step, scaled

TOLERANCE = 1e-12
LIMIT = 40
EASY = 6

MOST_STEPS = 100_000
"""Steps of a finite displacement; more take minutes, and a step is halved where it fails."""
"""Newton steps within which a part of a displacement must close; else it is cut in half, since it may have changed its branch."""


@dataclass(frozen=True, eq=False)
class Position:
    """A solved position: q, the Newton steps taken, the relative residual, and its history."""

    q: np.ndarray
    iterations: int
    residual: float
    history: tuple[float, ...]

    def __repr__(self) -> str:
        return f"<Position of {len(self.q)} coordinates: {self.iterations} Newton steps, relative residual {self.residual:.2g}>"


def residual(kernels: Kernels, q: np.ndarray, t: float = 0.0, p: np.ndarray | None = None) -> float:
    """The largest |Φ| relative to the rows' natural sizes."""
    values = np.abs(kernels.phi(q, t, p)) / kernels.row_sizes
    return float(np.max(values, initial=0.0))


def solve_position(
    kernels: Kernels,
    q: ArrayOrNamed | None = None,
    t: float = 0.0,
    p: ArrayOrNamed | None = None,
    held: str | Iterable[str] | None = (),
    tolerance: float = TOLERANCE,
    limit: int = LIMIT,
) -> Position:
    """Solve the constraints for a position near another, by Newton's method.

    A position that is consistent already is returned to the last bit.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    q : array_like, shape (n,), or {name: value}, optional
        Position in m and rad to begin from. Default: the initial one.
    t : float
        Time in s.
    p : array_like, shape (n_p,), or {name: value}, optional
        Parameters. Default: the model's.
    held : str or iterable of str, optional
        Names of coordinates that keep their values.
    tolerance : float
        Relative residual of the constraints.
    limit : int
        Largest number of steps.

    Returns
    -------
    Position
        The position, the number of steps, and the residual.

    Raises
    ------
    ConvergenceError
        With the history of residuals and the worst constraint; also if an angle ends at its mirror root ψ + π.
    DomainError
        With the name of a constraint that is NaN or infinite.
    ModelError
        For invalid arguments.
    """
    p = argument_checks.parameters(kernels, p)
    q, t = argument_checks.position(kernels, q, p), argument_checks.finite(t, "t")
    tolerance, limit = argument_checks.positive(tolerance, "tolerance"), argument_checks.count(limit, "limit")
    names = argument_checks.names_of(held, "held", kernels.index)
    free = np.array([i for i, name in enumerate(kernels.coordinates) if name not in names], dtype=int)
    return newton_position(kernels, q, t, p, free, tolerance, limit)


def newton_position(
    kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray, free: np.ndarray, tolerance: float = TOLERANCE, limit: int = LIMIT
) -> Position:
    """As `solve_position`, for arguments that ncgen has made: no condition on parameters p (n_p,) is asked for.

    free: numbers of the coordinates that may change
    """
    sizes = kernels.row_sizes
    value = kernels.phi(q, t, p) / sizes
    history = [float(np.max(np.abs(value), initial=0.0))]
    while not history[-1] <= tolerance:
        if not np.isfinite(history[-1]) and (len(history) == 1 or is_finite(q)):
            check_finite(kernels, q, t, p)
        if len(history) > limit or not np.isfinite(history[-1]):
            raise ConvergenceError(_failure(kernels, value, history), tuple(history))
        rows = kernels.holonomic
        step = _least_step(watched(kernels), q, t, p, rows, free, -value[rows])
        q, value = _damped(kernels, q, free, step, value, t, p)
        history.append(float(np.max(np.abs(value), initial=0.0)))
    check_mirror_roots(kernels, q, p, history)
    return Position(q, len(history) - 1, history[-1], tuple(history))


def _least_step(
    kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray, rows: np.ndarray, free: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """The smallest change of some coordinates that changes rows, in their natural sizes, as wanted."""
    sizes = kernels.row_sizes[rows]
    if DENSE <= len(rows) <= len(free):
        jacobian = kernels.phi_q(q, t, p)[rows][:, free]
        if (step := least_step(scaled(jacobian, 1 / sizes, np.ones(len(free))), right)) is not None:
            return step
    return least_squares(kernels.jacobian(q, t, p)[np.ix_(rows, free)] / sizes[:, None], right, 1e-10)


def _damped(
    kernels: Kernels, q: np.ndarray, free: np.ndarray, step: np.ndarray, value: np.ndarray, t: float, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The longest of the step, its half, quarter … that lowers the residual; the shortest if none does."""
    norm, trial, new = np.linalg.norm(value), q, value
    for power in range(6):
        trial = q.copy()
        trial[free] += step / 2**power
        new = kernels.phi(trial, t, p) / kernels.row_sizes
        if np.linalg.norm(new) < norm:
            break
    return trial, new


def _failure(kernels: Kernels, value: np.ndarray, history: list[float]) -> str:
    worst = int(np.nanargmax(np.where(np.isfinite(value), np.abs(value), np.inf)))
    row = kernels.rows[worst]
    return (
        f"position problem: no convergence in {counted(len(history) - 1, 'step')}, the relative residual is {history[-1]:.2g}; "
        f"worst is row {worst + 1} ({row.label}, {row.owner}); start nearer to a closed position or move in smaller steps"
    )


def check_mirror_roots(kernels: Kernels, q: np.ndarray, p: np.ndarray | None = None, history: Sequence[float] = ()) -> None:
    """Raise ConvergenceError naming an angle whose coordinate is half a turn off its elements at q (…, n): the other root of its row."""
    known = angles(kernels)
    if not known:
        return
    errors = q[..., [kernels.index[angle.name] for angle in known]] - measured_angles(kernels, q, p)
    for k in np.flatnonzero(np.cos(errors) < 0.0)[:1].tolist():
        angle, error = known[k % len(known)], errors.flat[k]
        raise ConvergenceError(
            f"angle {angle.name}: the position found is the mirror root, {np.degrees(error) % 360:.1f} degrees off; "
            "start with the angle nearer to its elements",
            tuple(history),
        )


def check_finite(kernels: Kernels, q: np.ndarray, t: float = 0.0, p: np.ndarray | None = None) -> None:
    """Raise DomainError naming the first row or mass that is not a number at q, or the coordinate of q that is not a number."""
    check_instant(kernels, q, None, t, p)


def move(
    kernels: Kernels, q: ArrayOrNamed | None, targets: dict[str, float], t: float = 0.0, p: ArrayOrNamed | None = None, steps: int = 1
) -> Position:
    """Move coordinates to given values; the other coordinates follow and stay on their branch.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    q : array_like, shape (n,), or {name: value} or None
        Position in m and rad to begin from; None for the initial one.
    targets : {coordinate: value}
        Values in m and rad to reach.
    t : float
        Time in s.
    p : array_like, shape (n_p,), or {name: value}, optional
        Parameters. Default: the model's.
    steps : int
        Number of equal steps, which are halved where the solution fails.

    Returns
    -------
    Position
        The position at the end.

    Raises
    ------
    ConvergenceError
        Where the mechanism cannot reach the values.
    DeadCentreError
        Where it comes to a dead centre before. `positions` of both errors are those that were found.
    ModelError
        For invalid arguments.
    """
    p = argument_checks.parameters(kernels, p)
    q, t = argument_checks.position(kernels, q, p), argument_checks.finite(t, "t")
    end = argument_checks.numbers_by_name(targets, kernels.index, "targets")
    names, steps = list(end), argument_checks.count(steps, "steps")
    if steps > MOST_STEPS:
        raise ModelError(f"steps: {argument_checks.echo(steps)} given; {MOST_STEPS} are the most")
    where = [kernels.index[name] for name in names]
    start, end = q[where], np.array(list(end.values()))
    done, step = 0.0, 1.0 / steps
    result = Position(q, 0, residual(kernels, q, t, p), ())
    path = [q]

    def at(q: np.ndarray, fraction: float) -> Position:
        guess = q.copy()
        guess[where] = start + fraction * (end - start)
        return solve_position(kernels, guess, t, p, held=names, limit=EASY)

    while done < 1.0:
        fraction = min(1.0, done + step)
        try:
            result, done = at(result.q, fraction), fraction
            path.append(result.q)
        except ConvergenceError as error:
            step /= 2
            if step < 1e-4 / steps:
                last, reached = approached(lambda q, fraction: at(q, fraction).q, result.q, done, fraction)
                path.append(last)
                if reached < fraction:
                    raise _stopped(kernels, end, names, path, t, p, error) from error
                result, done = at(last, fraction), fraction
    return result


def _stopped(
    kernels: Kernels, end: np.ndarray, names: list[str], path: list[np.ndarray], t: float, p: np.ndarray, error: ConvergenceError
) -> ConvergenceError:
    """The error of a displacement of the named coordinates that ends before their values `end` are reached, at the last one of `path`."""
    where = [kernels.index[name] for name in names]
    free = np.array([i for i in range(kernels.n) if i not in where], dtype=int)
    targets = ", ".join(f"{name} = {value:.9g}" for name, value in zip(names, end, strict=True))
    reached = ", ".join(f"{name} = {value:.9g}" for name, value in zip(names, path[-1][where], strict=True))
    positions = np.array(path)
    if is_dead_centre(kernels, path[-1], t, p, free):
        message = f"{kernels.name}: {targets} is beyond a dead centre at {reached}; the positions up to there are `positions` of the error"
        return DeadCentreError(message, error.history, positions)
    return ConvergenceError(f"{kernels.name}: {targets} is not reached, the way ends at {reached}; {error}", error.history, positions)


def sweep(
    kernels: Kernels,
    name: str,
    values: ArrayLike | Iterator[float],
    q: ArrayOrNamed | None = None,
    t: float = 0.0,
    p: ArrayOrNamed | None = None,
) -> np.ndarray:
    """Compute positions while one coordinate takes given values, each started from the one before.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    name : str
        Name of the coordinate.
    values : array_like, shape (K,)
        Its values in m or rad.
    q : array_like, shape (n,), or {name: value}, optional
        Position in m and rad to begin from. Default: the initial one.
    t : float
        Time in s.
    p : array_like, shape (n_p,), or {name: value}, optional
        Parameters. Default: the model's.

    Returns
    -------
    array, shape (K, n)
        Positions in m and rad.

    Raises
    ------
    ConvergenceError
        Where the mechanism cannot reach a value.
    DeadCentreError
        Where it comes to a dead centre before: `positions` are those of the values before, and the one at which it stopped.
    ModelError
        For invalid arguments.
    """
    p = argument_checks.parameters(kernels, p)
    position, path = argument_checks.position(kernels, q, p), []
    argument_checks.known_name(name, kernels.index, "name")
    for value in argument_checks.several(values, "values"):
        try:
            position = move(kernels, position, {name: value}, t, p).q
        except ConvergenceError as error:
            if error.positions is not None:
                error.positions = np.array([*path, error.positions[-1]])
            raise
        path.append(position)
    return np.array(path).reshape(-1, kernels.n)
