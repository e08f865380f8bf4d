"""The robot's Φ, Φ_q, γ and dynamics written by hand from the paper's tables, to compare generated code with.

`loop_*` walk down the CONSTR table with a branch per code, as the paper's Matlab functions do; `vector_*` take all rows
of a type at once with index arrays. Nothing here is derived by a program: the derivatives were done on paper.

Rows are scaled and ordered like ncgen's (distances by 1/2L, unit vectors by 1/2, angles by 1/(la lb)), and q holds the
free coordinates, so that results can be subtracted from the generated ones. An angle's row is

    [sin psi a.b - cos psi (a x b).n / |n|] / (|a| |b|)        a, b perpendicular to n

`derivative` is the paper's Table 8 in NumPy: coordinate partitioning, Newton's method from the last position. That
position is an argument here, not a persistent variable (docs/paper.md says why).
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike

from ncgen.exchange.examples import example_module

tables = example_module("robot")

# Table 1: where points and vectors start in the full q of 45 entries, and which entries move (0-based).
R = tables.P[:, 3].astype(int) - 1
U = tables.U[:, 3].astype(int) - 1
PSI = 39
FULL = np.zeros(45)
for place, xyz in zip([*R, *U], [*tables.P[:, :3], *tables.U[:, :3]], strict=True):
    FULL[place : place + 3] = xyz
FREE = np.array([i for i in range(45) if i + 1 not in tables.FIXED])
CONSTR = tables.RIGID + tables.ANGLES
GRAVITY = np.array([0.0, 0.0, -9.81])

# -- (a) in the paper's manner: a loop over CONSTR with a branch per code ----------------------------------------------


def full(q: np.ndarray) -> np.ndarray:
    """All 45 coordinates from the 36 free ones."""
    x = FULL.copy()
    x[FREE] = q
    return x


def full_rates(qd: np.ndarray) -> np.ndarray:
    """All 45 velocities: fixed coordinates do not move."""
    v = np.zeros(45)
    v[FREE] = qd
    return v


def point(x: np.ndarray, i: int) -> np.ndarray:
    return x[R[i - 1] : R[i - 1] + 3]


def vector(x: np.ndarray, i: int) -> np.ndarray:
    """Vector number i; a negative number means the reversed vector."""
    start = U[abs(i) - 1]
    return x[start : start + 3] if i > 0 else -x[start : start + 3]


def angle_vectors(row: list, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """a, b and n of an angle row."""
    code, i, j, k, l, w = row[:6]
    if code == 1010:  # segments ri -> rj and rk -> rl about a vector
        return point(x, j) - point(x, i), point(x, l) - point(x, k), vector(x, w)
    if code == 1012:  # vectors ui, uj about the vector uk
        return vector(x, i), vector(x, j), vector(x, k)
    if code == 1013:  # vectors ui, uj about the segment rl -> rk
        return vector(x, i), vector(x, j), point(x, k) - point(x, l)
    # 1014: vector ui, segment rk -> rj about a vector
    return vector(x, i), point(x, j) - point(x, k), vector(x, l)


def angle_sizes(row: list) -> tuple[float, float]:
    """1/(la lb) and |n| of an angle row."""
    code, la, lb = row[0], row[9], row[10]
    if code == 1010:
        return 1.0 / (la * lb), 1.0
    if code == 1012:
        return 1.0, 1.0
    if code == 1013:
        return 1.0, lb
    return 1.0 / lb, 1.0


def loop_phi(q: np.ndarray) -> np.ndarray:
    """Φ, row by row."""
    x = full(q)
    phi = np.zeros(len(CONSTR))
    for r, row in enumerate(CONSTR):
        code, i, j, k = row[:4]
        if code == 1000:
            a = point(x, i) - point(x, j)
            phi[r] = (a @ a - row[11] ** 2) / (2 * row[11])
        elif code == 1001:
            u = vector(x, i)
            phi[r] = (u @ u - 1) / 2
        elif code == 1002:
            phi[r] = (vector(x, i) @ (point(x, j) - point(x, k)) - row[10] * row[11]) / row[10]
        elif code == 1003:
            phi[r] = vector(x, i) @ vector(x, j) - row[11]
        else:
            a, b, n = angle_vectors(row, x)
            scale, ln = angle_sizes(row)
            psi = x[PSI + row[11] - 1]
            phi[r] = scale * (np.sin(psi) * (a @ b) - np.cos(psi) * (np.cross(a, b) @ n) / ln)
    return phi


def loop_phi_q(q: np.ndarray) -> np.ndarray:
    """Φ_q over the free coordinates, dense."""
    x = full(q)
    J = np.zeros((len(CONSTR), 45))

    def add_point(r: int, i: int, value: np.ndarray) -> None:
        J[r, R[i - 1] : R[i - 1] + 3] += value

    def add_vector(r: int, i: int, value: np.ndarray) -> None:
        J[r, U[abs(i) - 1] : U[abs(i) - 1] + 3] += value if i > 0 else -value

    for r, row in enumerate(CONSTR):
        code, i, j, k, l, w = row[:6]
        if code == 1000:
            a = (point(x, i) - point(x, j)) / row[11]
            add_point(r, i, a)
            add_point(r, j, -a)
        elif code == 1001:
            add_vector(r, i, vector(x, i))
        elif code == 1002:
            u = vector(x, i) / row[10]
            add_vector(r, i, (point(x, j) - point(x, k)) / row[10])
            add_point(r, j, u)
            add_point(r, k, -u)
        elif code == 1003:
            add_vector(r, i, vector(x, j))
            add_vector(r, j, vector(x, i))
        else:
            a, b, n = angle_vectors(row, x)
            scale, ln = angle_sizes(row)
            psi = x[PSI + row[11] - 1]
            s, c, ab = scale * np.sin(psi), scale * np.cos(psi), np.cross(a, b)
            ga, gb, gn = s * b - c / ln * np.cross(b, n), s * a - c / ln * np.cross(n, a), -c / ln * ab
            J[r, PSI + row[11] - 1] = c * (a @ b) + s * (ab @ n) / ln
            if code == 1010:
                add_point(r, j, ga)
                add_point(r, i, -ga)
                add_point(r, l, gb)
                add_point(r, k, -gb)
                add_vector(r, w, gn)
            elif code == 1012:
                add_vector(r, i, ga)
                add_vector(r, j, gb)
                add_vector(r, k, gn)
            elif code == 1013:
                add_vector(r, i, ga)
                add_vector(r, j, gb)
                add_point(r, k, gn)
                add_point(r, l, -gn)
            else:
                add_vector(r, i, ga)
                add_point(r, j, gb)
                add_point(r, k, -gb)
                add_vector(r, l, gn)
    return J[:, FREE]


def loop_gamma(q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """γ, with Φ_q q̈ = γ."""
    x, v = full(q), full_rates(qd)
    gamma = np.zeros(len(CONSTR))
    for r, row in enumerate(CONSTR):
        code, i, j, k = row[:4]
        if code == 1000:
            a = point(v, i) - point(v, j)
            gamma[r] = -(a @ a) / row[11]
        elif code == 1001:
            u = vector(v, i)
            gamma[r] = -(u @ u)
        elif code == 1002:
            gamma[r] = -2 * (vector(v, i) @ (point(v, j) - point(v, k))) / row[10]
        elif code == 1003:
            gamma[r] = -2 * (vector(v, i) @ vector(v, j))
        else:
            a, b, n = angle_vectors(row, x)
            da, db, dn = angle_vectors(row, v)
            scale, ln = angle_sizes(row)
            psi, w = x[PSI + row[11] - 1], v[PSI + row[11] - 1]
            s, c = np.sin(psi), np.cos(psi)
            D, dD, ddD = a @ b, da @ b + a @ db, 2 * (da @ db)
            ab, dab = np.cross(a, b), np.cross(da, b) + np.cross(a, db)
            T, dT, ddT = ab @ n / ln, (dab @ n + ab @ dn) / ln, 2 * (np.cross(da, db) @ n + dab @ dn) / ln
            gamma[r] = -scale * (s * (ddD - w * w * D + 2 * w * dT) + c * (2 * w * dD - ddT + w * w * T))
    return gamma


# -- (b) all rows of a type at once ------------------------------------------------------------------------------------

ZERO = 45  # three zeros at the end of x: the start of what is not a difference

Ends = tuple[int, int]
"""Where a difference of two places in x ends and begins."""


def _rows(*codes: int) -> np.ndarray:
    return np.array([r for r, row in enumerate(CONSTR) if row[0] in codes])


def _xyz(places: ArrayLike) -> np.ndarray:
    return np.asarray(places)[:, None] + np.arange(3)


def _points(rows: np.ndarray, column: int) -> np.ndarray:
    return _xyz([R[CONSTR[r][column] - 1] for r in rows])


def _vectors(rows: np.ndarray, column: int) -> np.ndarray:
    return _xyz([U[CONSTR[r][column] - 1] for r in rows])


def _numbers(rows: np.ndarray, column: int) -> np.ndarray:
    return np.array([float(CONSTR[r][column]) for r in rows])


def _angle_places(row: list) -> tuple[tuple[Ends, Ends, Ends], int]:
    """Where a, b and n of an angle row end and begin in x, and the sign of n."""
    code, i, j, k, l, w = row[:6]
    if code == 1010:
        return ((R[j - 1], R[i - 1]), (R[l - 1], R[k - 1]), (U[abs(w) - 1], ZERO)), np.sign(w)
    if code == 1012:
        return ((U[i - 1], ZERO), (U[j - 1], ZERO), (U[abs(k) - 1], ZERO)), np.sign(k)
    if code == 1013:
        return ((U[i - 1], ZERO), (U[j - 1], ZERO), (R[k - 1], R[l - 1])), 1
    return ((U[i - 1], ZERO), (R[j - 1], R[k - 1]), (U[abs(l) - 1], ZERO)), np.sign(l)


def _angles(rows: np.ndarray) -> SimpleNamespace:
    places, signs = zip(*(_angle_places(CONSTR[r]) for r in rows), strict=True)
    ends = {name: (_xyz([p[k][0] for p in places]), _xyz([p[k][1] for p in places])) for k, name in enumerate("abn")}
    scale, ln = (np.array(values) for values in zip(*(angle_sizes(CONSTR[r]) for r in rows), strict=True))
    sign = np.array(signs, dtype=float)
    return SimpleNamespace(rows=rows, column=rows[:, None], psi=np.array([PSI + CONSTR[r][11] - 1 for r in rows]),
                           scale=scale, weight=sign / ln, **ends)  # fmt: skip


D, N, S, V, A = _rows(1000), _rows(1001), _rows(1002), _rows(1003), _rows(1010, 1012, 1013, 1014)
DI, DJ, DL = _points(D, 1), _points(D, 2), _numbers(D, 11)
NU = _vectors(N, 1)
SU, SJ, SK, SL, SC = _vectors(S, 1), _points(S, 2), _points(S, 3), _numbers(S, 10), _numbers(S, 11)
VI, VJ, VC = _vectors(V, 1), _vectors(V, 2), _numbers(V, 11)
ANGLE = _angles(A)
DROW, NROW, SROW, VROW = D[:, None], N[:, None], S[:, None], V[:, None]
PADDED = np.concatenate([FULL, np.zeros(3)])


def padded(q: np.ndarray) -> np.ndarray:
    x = PADDED.copy()
    x[FREE] = q
    return x


def padded_rates(qd: np.ndarray) -> np.ndarray:
    v = np.zeros(48)
    v[FREE] = qd
    return v


def dots(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Row by row."""
    return np.einsum("ij,ij->i", a, b)


def crosses(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Row by row; np.cross takes ten times as long."""
    ax, ay, az = a.T
    bx, by, bz = b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _abn(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    a, b = (x[end] - x[start] for end, start in (ANGLE.a, ANGLE.b))
    end, start = ANGLE.n
    return a, b, (x[end] - x[start]) * ANGLE.weight[:, None]


def vector_phi(q: np.ndarray) -> np.ndarray:
    """Φ, type by type."""
    x = padded(q)
    phi = np.empty(len(CONSTR))
    a = x[DI] - x[DJ]
    phi[D] = (dots(a, a) - DL**2) / (2 * DL)
    phi[N] = (dots(x[NU], x[NU]) - 1) / 2
    phi[S] = dots(x[SU], x[SJ] - x[SK]) / SL - SC
    phi[V] = dots(x[VI], x[VJ]) - VC
    a, b, n = _abn(x)
    psi = x[ANGLE.psi]
    phi[A] = ANGLE.scale * (np.sin(psi) * dots(a, b) - np.cos(psi) * dots(crosses(a, b), n))
    return phi


def vector_phi_q(q: np.ndarray) -> np.ndarray:
    """Φ_q over the free coordinates, dense."""
    x = padded(q)
    J = np.zeros((len(CONSTR), 48))
    a = (x[DI] - x[DJ]) / DL[:, None]
    J[DROW, DI] = a
    J[DROW, DJ] = -a
    J[NROW, NU] = x[NU]
    u = x[SU] / SL[:, None]
    J[SROW, SU] = (x[SJ] - x[SK]) / SL[:, None]
    J[SROW, SJ] = u
    J[SROW, SK] = -u
    J[VROW, VI] = x[VJ]
    J[VROW, VJ] = x[VI]
    a, b, n = _abn(x)
    psi = x[ANGLE.psi]
    s, c = (ANGLE.scale * np.sin(psi))[:, None], (ANGLE.scale * np.cos(psi))[:, None]
    ab = crosses(a, b)
    gradients = s * b - c * crosses(b, n), s * a - c * crosses(n, a), -c * ANGLE.weight[:, None] * ab
    for (end, start), gradient in zip((ANGLE.a, ANGLE.b, ANGLE.n), gradients, strict=True):
        J[ANGLE.column, end] += gradient
        J[ANGLE.column, start] -= gradient
    J[A, ANGLE.psi] = c[:, 0] * dots(a, b) + s[:, 0] * dots(ab, n)
    return J[:, FREE]


def vector_gamma(q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """γ, with Φ_q q̈ = γ."""
    x, v = padded(q), padded_rates(qd)
    gamma = np.empty(len(CONSTR))
    a = v[DI] - v[DJ]
    gamma[D] = -dots(a, a) / DL
    gamma[N] = -dots(v[NU], v[NU])
    gamma[S] = -2 * dots(v[SU], v[SJ] - v[SK]) / SL
    gamma[V] = -2 * dots(v[VI], v[VJ])
    (a, b, n), (da, db, dn) = _abn(x), _abn(v)
    psi, w = x[ANGLE.psi], v[ANGLE.psi]
    s, c = np.sin(psi), np.cos(psi)
    ab, dab = crosses(a, b), crosses(da, b) + crosses(a, db)
    D0, D1, D2 = dots(a, b), dots(da, b) + dots(a, db), 2 * dots(da, db)
    T0, T1, T2 = dots(ab, n), dots(dab, n) + dots(ab, dn), 2 * (dots(crosses(da, db), n) + dots(dab, dn))
    gamma[A] = -ANGLE.scale * (s * (D2 - w * w * D0 + 2 * w * T1) + c * (2 * w * D1 - T2 + w * w * T0))
    return gamma


# -- inertia -----------------------------------------------------------------------------------------------------------


Body = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Where a body's coordinates are in q, its mass matrix and its weight over them."""


def inertia_on_basis(body: dict, origin: np.ndarray, axes: np.ndarray, points: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """The 4x4 inertia and the weights of the centre of mass over the elements (r, e1, e2, e3).

    axes: the three directions in the initial position, as columns; points: which of them are points minus r
    """
    m, I, d = body["m"], np.asarray(body["IT"], dtype=float), np.asarray(body["cog"], dtype=float) - origin
    inverse = np.linalg.inv(axes)
    a = inverse @ d
    Z = inverse @ (np.trace(I) / 2 * np.eye(3) - I + m * np.outer(d, d)) @ inverse.T
    standard = np.block([[np.array([[m]]), m * a[None, :]], [m * a[:, None], Z]])
    T = np.eye(4)
    T[1:, 0] = -np.asarray(points, dtype=float)
    return T.T @ standard @ T, m * np.concatenate([[1.0], a]) @ T


def _constant_body(number: int, elements: list[int], points: Sequence[int]) -> Body:
    """A body on four elements, whose mass matrix is constant; elements: places in q."""
    origin, *others = (FULL[e : e + 3] for e in elements)
    axes = np.stack([e - p * origin for e, p in zip(others, points, strict=True)], axis=1)
    matrix, weights = inertia_on_basis(tables.INERTIA[number], origin, axes, points)
    return _xyz(elements).ravel(), np.kron(matrix, np.eye(3)), np.kron(weights, GRAVITY)


def _crossed_body(number: int, ri: int, rj: int, u: int) -> Body:
    """A body on two points and a vector: the third direction is (rj - ri) x u."""
    origin, x1, x2 = FULL[ri : ri + 3], FULL[rj : rj + 3] - FULL[ri : ri + 3], FULL[u : u + 3]
    axes = np.stack([x1, x2, np.cross(x1, x2)], axis=1)
    matrix, weights = inertia_on_basis(tables.INERTIA[number], origin, axes, (1, 0, 0))
    return _xyz([ri, rj, u]).ravel(), np.kron(matrix, np.eye(3)), np.kron(weights, GRAVITY)


def _r(i: int) -> int:
    return R[i - 1]


def _u(i: int) -> int:
    return U[i - 1]


CONSTANT = [
    _constant_body(2, [_r(1), _r(2), _u(1), _u(3)], (1, 0, 0)),
    _constant_body(5, [_r(4), _r(6), _r(5), _u(3)], (1, 1, 0)),
]
CROSSED = [
    _crossed_body(3, _r(2), _r(4), _u(3)),
    _crossed_body(4, _r(3), _r(5), _u(3)),
    _crossed_body(6, _r(6), _r(7), _u(3)),
    _crossed_body(7, _r(6), _r(7), _u(4)),
    _crossed_body(8, _r(7), _r(8), _u(4)),
    _crossed_body(9, _r(7), _r(8), _u(5)),
]
M0, Q0 = np.zeros((45, 45)), np.zeros(45)
for _where, _matrix, _weight in CONSTANT:
    M0[np.ix_(_where, _where)] += _matrix
    Q0[_where] += _weight
WHERE = np.array([where for where, _, _ in CROSSED])
M12 = np.array([matrix for _, matrix, _ in CROSSED])
Q12 = np.array([weight for _, _, weight in CROSSED])


def tilde(a: np.ndarray) -> np.ndarray:
    """Matrices of the cross product, ã b = a x b, of all rows of a."""
    matrices = np.zeros((len(a), 3, 3))
    matrices[:, 2, 1], matrices[:, 0, 2], matrices[:, 1, 0] = a.T
    return matrices - matrices.transpose(0, 2, 1)


def transition(x: np.ndarray) -> np.ndarray:
    """W of all crossed bodies: the velocities of (ri, rj, u, w) are W times those of (ri, rj, u)."""
    q9 = x[WHERE]
    W = np.zeros((len(CROSSED), 12, 9))
    W[:, range(9), range(9)] = 1.0
    u = tilde(q9[:, 6:])
    W[:, 9:, :3], W[:, 9:, 3:6], W[:, 9:, 6:] = u, -u, tilde(q9[:, 3:6] - q9[:, :3])
    return W


def mass_and_force(q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """M over the free coordinates, dense, and Q: weights and the crossed bodies' velocity-dependent inertia."""
    x, v = full(q), full_rates(qd)
    W = transition(x)
    half = W.transpose(0, 2, 1) @ M12
    M, Q = M0.copy(), Q0.copy()
    np.add.at(M, (WHERE[:, :, None], WHERE[:, None, :]), half @ W)
    v9 = v[WHERE]
    turning = 2 * crosses(v9[:, 3:6] - v9[:, :3], v9[:, 6:])
    force = np.einsum("bji,bj->bi", W, Q12) - np.einsum("bij,bj->bi", half[:, :, 9:], turning)
    np.add.at(Q, WHERE, force)
    return M[np.ix_(FREE, FREE)], Q[FREE]


# -- Table 8: coordinate partitioning ----------------------------------------------------------------------------------

INDEPENDENT = np.arange(30, 36)  # the six angles
DEPENDENT = np.arange(30)
KEPT = np.array([r for r in range(len(CONSTR)) if r != 11])  # u3.(r3 - r5) follows from three rows of its kind
TOLERANCE = 1e-12


def position(z: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """The dependent coordinates that belong to the angles z, by Newton's method."""
    q = guess.copy()
    q[INDEPENDENT] = z
    for _ in range(40):
        phi = vector_phi(q)[KEPT]
        if np.abs(phi).max() < TOLERANCE:
            return q
        q[DEPENDENT] -= np.linalg.solve(vector_phi_q(q)[np.ix_(KEPT, DEPENDENT)], phi)
    raise ArithmeticError("Newton's method does not converge")


def derivative(t: float, y: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """ẏ of y = (ż, z), z the six angles.

    guess: a position nearby, from which Newton's method starts; it is overwritten by the position found
    """
    zd, z = y[:6], y[6:]
    q = position(z, guess)
    guess[:] = q
    J = vector_phi_q(q)[KEPT]
    inverse = np.linalg.inv(J[:, DEPENDENT])
    basis = np.zeros((36, 6))
    basis[DEPENDENT], basis[INDEPENDENT] = -inverse @ J[:, INDEPENDENT], np.eye(6)
    qd = basis @ zd
    bias = np.zeros(36)
    bias[DEPENDENT] = inverse @ vector_gamma(q, qd)[KEPT]
    M, Q = mass_and_force(q, qd)
    zdd = np.linalg.solve(basis.T @ M @ basis, basis.T @ (Q - M @ bias))
    return np.concatenate([zdd, zd])


def data(q: np.ndarray) -> dict[str, object]:
    """The tables and a start as plain numbers, places counted from 1, for handwritten.m."""
    bodies = [
        {"places": (where + 1).tolist(), "mass": mass.tolist(), "weight": weight.tolist()} for where, mass, weight in CONSTANT + CROSSED
    ]
    return {
        "P": (R + 1).tolist(), "U": (U + 1).tolist(), "CONSTR": CONSTR, "qini": full(q).tolist(), "bodies": bodies,
        "free": (FREE + 1).tolist(), "qind": (FREE[INDEPENDENT] + 1).tolist(), "qdep": (FREE[DEPENDENT] + 1).tolist(),
    }  # fmt: skip


END = {"psi2": 0.26154171434234150, "psi3": 0.30810884512921474, "psi5": -3.4044318734841151}
"""The angles after the fall of 0.5 s, found by two independent routes at tight tolerance; psi1, psi4 and psi6 stay."""

PAPER_TABLE_9 = {"ode113": (1.843, 73.469), "ode45": (4.125, 198.625), "ode15s": (3.953, 183.859)}
"""The fall in Matlab on a Pentium IV of 3 GHz (2007), seconds: Jacobians written by hand, and differentiated by ADiMat."""

PAPER_TABLE_10 = {"ode23t": (7.531, 9.266), "ode15s": (3.953, 7.765)}
"""Implicit integrators, seconds: the Jacobian of the state derivative by differences, and by ADiMat."""
