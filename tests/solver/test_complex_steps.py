"""The linearisation of every example beside complex steps through the whole derivative.

The programs of rows, masses and forces are evaluated in complex numbers, positions and velocities closed and accelerations solved there: no
generated derivative but Φ_q, which only closes, takes part. A step of 1e-30 leaves no error of differences.
"""

from __future__ import annotations

import cmath

import numpy as np
import pytest
from every_example import EVERY

import ncgen
from ncgen.model.elements import Point
from ncgen.program.ir.evaluate import evaluate
from ncgen.solver.positions.partition import choose_partitions

STEP = 1e-30


def _atan2(y: complex, x: complex) -> complex:
    """Of a complex number beside the real axis."""
    y, x = complex(y), complex(x)
    slope = (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)
    return complex(np.arctan2(y.real, x.real), slope)


FUNCTIONS = {
    name: getattr(cmath, name) for name in ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log")
}
FUNCTIONS |= {
    "atan2": _atan2,
    "abs": lambda x: x if complex(x).real >= 0 else -x,
    "sign": lambda x: float(np.sign(complex(x).real)),
    "pow": lambda x, y: complex(x) ** y,
}


class Complex:
    """A mechanism's kernels in complex numbers, and its motion from independent coordinates."""

    def __init__(self, kernels) -> None:
        self.kernels, self.programs, self.p = kernels, kernels.programs.programs, kernels.p0.astype(complex)

    def of(self, name: str, q, qd=None) -> np.ndarray:
        if name not in self.programs:
            return np.zeros(self.kernels.n if name == "force" else self.kernels.m, dtype=complex)
        given = {"t": 0.0, "q": list(q), "qd": list(q if qd is None else qd), "p": self.p.tolist()}
        return np.array(evaluate(self.programs[name], given, FUNCTIONS, complex))

    def matrix(self, name: str, pattern, q) -> np.ndarray:
        found = np.zeros(pattern.shape, dtype=complex)
        if name in self.programs:
            found.flat[pattern.flat] = self.of(name, q)
        return found

    def derivative(self, partitions, q0: np.ndarray, z, zd) -> np.ndarray:
        """ẋ of x = [z; ż]."""
        _, qd, qdd = self.motion(partitions, q0, z, zd)
        return np.concatenate([qd[partitions.position.independent], qdd[partitions.velocity.independent]])

    def motion(self, partitions, q0: np.ndarray, z, zd) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, q̇ and q̈."""
        kernels, position, velocity = self.kernels, partitions.position, partitions.velocity
        q = q0.astype(complex)
        q[position.independent] = z
        for _ in range(3):
            jacobian = self.matrix("phi_q", kernels.phi_q_pattern, q)[np.ix_(position.rows, position.dependent)]
            if position.rows.size:
                q[position.dependent] -= np.linalg.solve(jacobian, self.of("phi", q)[position.rows])
        whole = self.matrix("phi_q", kernels.phi_q_pattern, q)[velocity.rows]
        qd = np.zeros(kernels.n, dtype=complex)
        qd[velocity.independent] = zd
        missing = self.of("nu", q)[velocity.rows] - whole @ qd
        if len(missing):
            qd[velocity.dependent] = np.linalg.solve(whole[:, velocity.dependent], missing)
        mass, m = self.matrix("mass", kernels.mass_pattern, q), len(whole)
        size = np.max(np.abs(mass)) / np.max(np.abs(whole), initial=1e-300) if m else 1.0
        saddle = np.block([[mass, size * whole.T], [size * whole, np.zeros((m, m))]])
        right = np.concatenate([self.of("force", q, qd), size * self.of("gamma", q, qd)[velocity.rows]])
        return q, qd, np.linalg.solve(saddle, right)[: kernels.n]


@pytest.mark.filterwarnings("ignore:.*neither rest in equilibrium")
@pytest.mark.parametrize("name", EVERY)
def test_linearise(name):
    """At the start, at rest; what rolls at rest, too."""
    kernels = ncgen.compile(ncgen.load(name), backend="numpy")
    if ncgen.freedom(kernels).is_singular:
        pytest.skip("it begins in a singular position")
    near = ncgen.linearise(kernels)
    if not near.positions:
        pytest.skip("drivers leave nothing free")
    q = ncgen.solve_position(kernels, kernels.q0).q
    partitions = choose_partitions(kernels, q, 0.0, kernels.p0, kernels.model.chosen_independent)
    assert near.positions == partitions.position.names(kernels)
    whole = Complex(kernels)
    z, zd = q[partitions.position.independent], np.zeros(len(partitions.velocity.independent))
    expected = np.zeros_like(near.matrix)
    for k in range(len(expected)):
        x = np.concatenate([z, zd]).astype(complex)
        x[k] += 1j * STEP
        expected[:, k] = whole.derivative(partitions, q, x[: len(z)], x[len(z) :]).imag / STEP
    for half in (slice(None, len(z)), slice(len(z), None)):
        size = 1 + np.max(np.abs(expected[half]))
        assert np.allclose(near.matrix[half], expected[half], rtol=0, atol=1e-9 * size), np.max(np.abs(near.matrix - expected)) / size


@pytest.mark.filterwarnings("ignore:.*neither rest in equilibrium")
@pytest.mark.parametrize("name", EVERY)
def test_inputs_and_outputs(name):
    """B, C and D of a push on the first point that can move, and of a number that looks at position, velocity and acceleration there."""
    model = ncgen.load(name)
    point, k = next((e, k) for e in model.elements.values() if isinstance(e, Point) for k in range(3) if not e.components[k].fixed)
    force = [0.0, 0.0, 0.0]
    force[k] = model.input("push", "N") * (1 + 0.3 * point.components[k].symbol)
    model.force(point, force)
    seen = point.components[k]
    model.output("seen", seen.acceleration + seen.rate**2 + seen.symbol**3 * model.inputs["push"].symbol)
    kernels = ncgen.compile(model, backend="numpy")
    if ncgen.freedom(kernels).is_singular:
        pytest.skip("it begins in a singular position")
    near = ncgen.linearise(kernels, p={"push": 1.5})
    if not near.positions:
        pytest.skip("drivers leave nothing free")
    q = ncgen.solve_position(kernels, kernels.q0).q
    partitions = choose_partitions(kernels, q, 0.0, kernels.p0, kernels.model.chosen_independent)
    assert near.positions == partitions.position.names(kernels)
    z, zd, place = q[partitions.position.independent], np.zeros(len(partitions.velocity.independent)), kernels.index[seen.name]

    def along(x: np.ndarray, push: complex) -> tuple[np.ndarray, complex]:
        """ẋ and the output, as they change with the imaginary parts of x and push."""
        whole = Complex(kernels)
        whole.p[kernels.parameters.index("push")] = push
        at, rate, acceleration = whole.motion(partitions, q, x[: len(z)], x[len(z) :])
        derivative = np.concatenate([rate[partitions.position.independent], acceleration[partitions.velocity.independent]])
        return derivative.imag / STEP, (acceleration[place] + rate[place] ** 2 + at[place] ** 3 * push).imag / STEP

    rest, u, y = np.concatenate([z, zd]), near.inputs.index("push"), near.outputs.index("seen")
    by_push, through = along(rest.astype(complex), 1.5 + 1j * STEP)
    assert np.allclose(near.B[:, u], by_push, rtol=0, atol=1e-9 * (1 + np.max(np.abs(by_push))))
    assert np.isclose(near.D[y, u], through, rtol=0, atol=1e-9 * (1 + abs(through)))
    expected = np.array([along(rest + 1j * STEP * direction, 1.5)[1] for direction in np.eye(len(rest))])
    assert np.allclose(near.C[y], expected, rtol=0, atol=1e-9 * (1 + np.max(np.abs(expected))))
