"""Rank of the Jacobian: degrees of freedom, redundant rows with what implies them, singular positions.

Rank is numerical and is taken at several consistent positions, because one position may be special.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from ncgen.errors import ConvergenceError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.singular_values import least_squares, singular_values, svd
from ncgen.solver import argument_checks
from ncgen.solver.argument_checks import ArrayOrNamed
from ncgen.solver.positions.described_position import found_in_described, is_described
from ncgen.solver.positions.open_tree import known_tree, open_tree, sampled
from ncgen.solver.positions.position import TOLERANCE, check_finite, solve_position
from ncgen.solver.positions.row_choice import best_rows, first_independent, represents_badly
from ncgen.solver.positions.sparse_rows import DENSE, independent_rows, scaled
from ncgen.solver.positions.tree_rank import MIN_COEFFICIENT, Implications, implied_rows

if TYPE_CHECKING:
    import scipy.sparse.linalg

RELATIVE_ZERO = 1e-9
"""Singular values below this, relative to the largest, count as zero."""

CLEAR_FRACTION = 1e-3
"""Share of the largest singular value from which the least one is no question of rounding, nor of how rows are scaled."""

POSITIONS = 6
DISTANCE = 0.1
"""How far the trial positions are from the given one, relative to the mechanism's size."""

REMEMBERED = 16
"""How much of what was found for positions, such as degrees of freedom, is kept with the kernels."""

MIN_CACHED_ROWS = 8
"""Rows from which on the degrees of freedom in the position that a model describes are kept in the cache: finding them takes longer, and a
process that reads them imports no random numbers."""

MIN_TREE_ROWS = 100
"""Rows from which on the joints of an open tree tell the rank: with as many it moves in loops over its tables, which are known then."""

NEIGHBOUR = 1e-3
"""How far a neighbouring position is, likewise."""


def numerical_rank(jacobian: np.ndarray) -> int:
    """Rank by singular values."""
    return _rank_of(singular_values(jacobian))


def _rank_of(values: np.ndarray) -> int:
    """How many singular values are not zero but for rounding."""
    return int(np.sum(values > RELATIVE_ZERO * max(values[0], 1e-300))) if len(values) else 0


def null_space(jacobian: np.ndarray) -> np.ndarray:
    """An orthonormal basis of the null space, columns (n, n − rank)."""
    _, values, right = svd(jacobian, full=True)
    return right[_rank_of(values) :].T


def scaled_jacobian(kernels: Kernels, q: np.ndarray, t: float = 0.0, p: np.ndarray | None = None) -> np.ndarray:
    """Φ_q with rows divided by their natural size and lengths measured in the mechanism's size."""
    return kernels.jacobian(q, t, p) * kernels.column_sizes / kernels.row_sizes[:, None]


def sparse_jacobian(kernels: Kernels, q: np.ndarray, t: float = 0.0, p: np.ndarray | None = None) -> scipy.sparse.csr_array:
    """`scaled_jacobian`, sparse."""
    return scaled(kernels.phi_q(q, t, p), 1 / kernels.row_sizes, kernels.column_sizes)


def _allowed(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray | None) -> Callable[[np.ndarray], np.ndarray] | None:
    """What leaves of any change of the coordinates the part that the rows allow; None where they allow nothing."""
    if DENSE <= kernels.m < kernels.n and (rows := independent_rows(sparse_jacobian(kernels, q, t, p))):
        return rows.allowed
    basis = null_space(scaled_jacobian(kernels, q, t, p))
    return (lambda x: basis @ (basis.T @ x)) if basis.shape[1] else None  # which does not depend on the choice of the basis


def can_move(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray | None) -> bool:
    """Whether the rows allow any change of the coordinates."""
    return _allowed(kernels, q, t, p) is not None


def closeness_at(kernels: Kernels, q: np.ndarray) -> float:
    """The tolerance of positions around q: far from the origin they close as well as coordinates can be told apart there."""
    return max(TOLERANCE, 8 * np.finfo(float).eps * float(np.max(np.abs(q) / kernels.column_sizes, initial=0.0)))


def trial_positions(
    kernels: Kernels, q: np.ndarray, t: float = 0.0, p: np.ndarray | None = None, count: int = POSITIONS, distance: float = DISTANCE
) -> list[np.ndarray]:
    """Consistent positions around q, reached along random motions; the seed is fixed, so they are always the same."""
    generator = np.random.default_rng(0)
    sizes, tolerance, allowed = kernels.column_sizes, closeness_at(kernels, q), _allowed(kernels, q, t, p)
    positions = [np.asarray(q, dtype=float)]
    for attempt in range(4 * count):
        if len(positions) > count or allowed is None:
            break
        step = allowed(generator.standard_normal(kernels.n))
        guess = q + distance / (1 + attempt // count) * sizes * step / max(np.max(np.abs(step)), 1e-300)
        try:
            positions.append(solve_position(kernels, guess, t, p, tolerance=tolerance).q)
        except ConvergenceError:
            continue  # too far for this mechanism: the next attempts are nearer
    return positions


@dataclass(frozen=True)
class Redundancy:
    """Row `row` (from 0) is implied by others: row = Σ coefficient · other row, with rows as generated."""

    row: int
    implied_by: dict[int, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Freedom:
    """Degrees of freedom of a mechanism.

    rank: of Φ_q in general position; rank_here: at the given position (less means it is singular)
    redundant: rows that others imply in every position tried
    vanishing: motions that exist only in this position, columns over the free coordinates
    """

    rank: int
    rank_here: int
    dof: int
    redundant: tuple[Redundancy, ...]
    kept_rows: tuple[int, ...]
    vanishing: np.ndarray
    positions: int

    def __repr__(self) -> str:
        where = f", {self.rank_here} here: singular" if self.is_singular else ""
        return f"<Freedom {self.dof}: rank {self.rank}{where}, {len(self.redundant)} redundant rows>"

    @property
    def is_singular(self) -> bool:
        """Return whether the position is singular.

        Returns
        -------
        bool
            True if the rank at the position is less than the general rank.
        """
        return self.rank_here < self.rank


def freedom(kernels: Kernels, q: ArrayOrNamed | None = None, t: float = 0.0, p: ArrayOrNamed | None = None) -> Freedom:
    """Find degrees of freedom, redundant constraints and singularity of a position.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.
    q : array_like, shape (n,), or {name: value}, optional
        Consistent position in m and rad. Default: the initial one.
    t : float
        Time in s.
    p : array_like, shape (n_p,), or {name: value}, optional
        Parameters. Default: the model's.

    Returns
    -------
    Freedom
        Rank, degrees of freedom, and redundant constraints with those that imply them.

    Raises
    ------
    ModelError
        For invalid arguments.
    """
    p = argument_checks.parameters(kernels, p)
    return freedom_at(kernels, argument_checks.position(kernels, q, p), argument_checks.finite(t, "t"), p)


def freedom_at(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> Freedom:
    """`freedom` of arguments that were looked at."""

    def find() -> Freedom:
        is_kept = kernels.m >= MIN_CACHED_ROWS and is_described(kernels, q, t, p)
        return (_freedom_from_cache if is_kept else _freedom)(kernels, q, t, p)

    return kernels.remember("freedom", (q.tobytes(), float(t), kernels.of_rows(p).tobytes()), find, REMEMBERED)


def rank_at(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> tuple[int, bool]:
    """The rank of Φ_q, and whether q is a singular position. A large open tree has none of these, and its joints tell the rank; which rows
    others imply is not looked for, and where they imply any, one general position near q confirms the rank of another position."""
    if kernels.m >= MIN_TREE_ROWS and (tree := known_tree(kernels)):
        return kernels.n - tree.freedoms, False
    rows = kernels.of_rows(p).tobytes()
    return kernels.remember("ranks", (q.tobytes(), float(t), rows), lambda: _rank_at(kernels, q, t, p, rows), REMEMBERED)


def _rank_at(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray, rows: bytes) -> tuple[int, bool]:
    """`rank_at` of what no tree tells; rows: the parameters that rows read."""
    here: list[Freedom] = []

    def whole() -> Freedom:
        if not here:
            here.append(freedom_at(kernels, q, t, p))
        return here[0]

    usual = kernels.remember("usual rank", rows, lambda: whole().rank, REMEMBERED)
    if not here and usual < kernels.m < DENSE and _has_rank(kernels, q, t, p, usual):
        return usual, False
    return whole().rank, whole().is_singular


def _has_rank(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray, rank: int) -> bool:
    """Whether Φ_q clearly has a rank, that of another position, at q and in a general position near it."""
    check_finite(kernels, q, t, p)
    positions = trial_positions(kernels, q, t, p, count=1)
    jacobians = [scaled_jacobian(kernels, x, t, p) for x in positions]
    largest = _largest_rows(jacobians)
    values = [singular_values(j / largest) for j in jacobians]
    return len(values) == 2 and all(_rank_of(v) == rank and (not rank or v[rank - 1] > CLEAR_FRACTION * v[0]) for v in values)


def _freedom_from_cache(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> Freedom:
    """The degrees of freedom in the position that a model describes, from the cache or found now."""

    def plain() -> dict[str, Any]:
        mobility = _freedom(kernels, q, t, p)
        rows = [[row.row, *map(list, row.implied_by.items())] for row in mobility.redundant]
        return vars(mobility) | {"redundant": rows, "kept_rows": list(mobility.kept_rows), "vanishing": mobility.vanishing.tolist()}

    members = found_in_described(kernels, f"freedom with SciPy {scipy.__version__}", plain)
    redundant = tuple(Redundancy(row, {k: c for k, c in implied}) for row, *implied in members.pop("redundant"))
    vanishing = np.array(members.pop("vanishing"), dtype=float).reshape(kernels.n, -1)
    return Freedom(redundant=redundant, kept_rows=tuple(members.pop("kept_rows")), vanishing=vanishing, **members)


def _freedom(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> Freedom:
    m, n = kernels.m, kernels.n
    check_finite(kernels, q, t, p)
    implied = _implied_in_tree(kernels, q, t, p) if MIN_TREE_ROWS <= m <= n else None
    if implied is None and DENSE <= m <= n and independent_rows(sparse_jacobian(kernels, q, t, p)):
        implied = {}
    if implied is None and m < DENSE and _has_clear_rank(scaled_jacobian(kernels, q, t, p)):
        implied = {}
    if implied is not None:
        kept, scale = [row for row in range(m) if row not in implied], kernels.row_sizes
        redundant = tuple(Redundancy(r, {k: c * scale[r] / scale[k] for k, c in parts.items()}) for r, parts in implied.items())
        still = np.zeros((n, 0))
        rank = len(kept)
        return Freedom(rank=rank, rank_here=rank, dof=n - rank, redundant=redundant, kept_rows=tuple(kept), vanishing=still, positions=1)
    positions = trial_positions(kernels, q, t, p)
    jacobians = [scaled_jacobian(kernels, x, t, p) for x in positions]
    largest = _largest_rows(jacobians)
    jacobians = [j / largest for j in jacobians]
    values = [singular_values(j) for j in jacobians]
    ranks = list(map(_rank_of, values))
    rank = max(ranks)
    general = [j for j, r in zip(jacobians, ranks, strict=True) if r == rank]
    kept = first_independent(general)
    if len(kept) != rank:  # rows at the edge of independence, which the order of exclusion decides
        kept = best_rows(general[-1], rank).tolist()
    elif represents_badly(general[0], kept, values[ranks.index(rank)]):
        kept = best_rows(general[0], rank).tolist()
    dependent = [row for row in range(m) if row not in set(kept)]
    scale = kernels.row_sizes
    redundant = _implications(general[-1] * largest, dependent, kept, scale)
    vanishing = _extra_motions(kernels, q, t, p, rank, largest) if ranks[0] < rank else np.zeros((kernels.n, 0))
    return Freedom(
        rank=rank,
        rank_here=ranks[0],
        dof=kernels.n - rank,
        redundant=redundant,
        kept_rows=tuple(kept),
        vanishing=vanishing,
        positions=len(positions),
    )


def _has_clear_rank(jacobian: np.ndarray) -> bool:
    """True for rows in natural units (m, n) that are far from being dependent: all ranks that there are, are theirs then."""
    m, n = jacobian.shape
    if not 0 < m <= n:
        return False
    values = np.linalg.eigvalsh(jacobian @ jacobian.T)
    return bool(values[0] > CLEAR_FRACTION**2 * values[-1])


def _implied_in_tree(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> Implications | None:
    """The rows of an open tree that others imply; None of any other mechanism, or where the tree does not tell."""
    tree = open_tree(kernels)
    return None if tree is None or not np.array_equal(p, kernels.p0) else implied_rows(tree, sampled(kernels, p, q, t))


def _largest_rows(jacobians: list[np.ndarray]) -> np.ndarray:
    """The norm of every row where it is largest, shape (m, 1): users' rows have no natural size, and one that is small everywhere is no
    dependent one. Rows that vanish in some position keep doing so."""
    norms = np.max([np.linalg.norm(j, axis=1) for j in jacobians], axis=0)
    return np.where(norms > 0, norms, 1.0)[:, None]


def _implications(jacobian: np.ndarray, dependent: list[int], kept: list[int], scale: np.ndarray) -> tuple[Redundancy, ...]:
    """The combinations of kept rows that dependent rows are."""
    solutions = least_squares(jacobian[kept].T, jacobian[dependent].T).T if dependent else []
    return tuple(
        Redundancy(row, {k: float(c * scale[row] / scale[k]) for k, c in zip(kept, solution, strict=True) if abs(c) > MIN_COEFFICIENT})
        for row, solution in zip(dependent, solutions, strict=True)
    )


def _extra_motions(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray, rank: int, largest: np.ndarray) -> np.ndarray:
    """Motions that are free at q and not just near it, in natural units, columns over the free coordinates.

    They are what is left of the null space at q without that of a neighbouring position in general position.
    """
    null_here = null_space(scaled_jacobian(kernels, q, t, p) / largest)
    neighbours = trial_positions(kernels, q, t, p, distance=NEIGHBOUR)[1:]
    spaces = [null_space(scaled_jacobian(kernels, x, t, p) / largest) for x in neighbours]
    general = next((s for s in spaces if s.shape[1] == kernels.n - rank), np.zeros((kernels.n, 0)))
    left, _, _ = svd(null_here.T @ general, full=True)
    return null_here @ left[:, general.shape[1] :]
