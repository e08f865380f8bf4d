"""Random trees and loops of bodies and joints: degrees of freedom by counting, kernels by complex step and differences.

Counting works because trees of spherical, revolute and universal joints have no redundancy beyond the unit norms that
revolute joints repeat; a loop is closed by a massless rod, which takes one degree of freedom.
"""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import ncgen

FREEDOM = {"spherical": 3, "revolute": 1, "universal": 2}
STEP = 1e-30


@st.composite
def trees(draw):
    """(seed, joints): every body hangs on an earlier one or on the ground; and how many rods close loops."""
    joints = draw(st.lists(st.tuples(st.sampled_from(sorted(FREEDOM)), st.integers(0, 3)), min_size=1, max_size=4))
    return draw(st.integers(0, 10**6)), joints, draw(st.integers(0, 2))


def build(seed: int, joints, rods: int) -> tuple[ncgen.Model, int]:
    """A mechanism in random geometry, and its degrees of freedom."""
    generator = np.random.default_rng(seed)
    m = ncgen.Model("random")
    bodies, dof = [m.ground], 0
    for k, (joint, choice) in enumerate(joints):
        parent = bodies[choice % len(bodies)]
        body, u = _body(m, k, generator)
        _join(m, joint, parent, body, u, k, generator)
        bodies.append(body)
        dof += FREEDOM[joint]
    for r in range(min(rods, dof - 1)):
        end = bodies[1 + r % (len(bodies) - 1)].points[0]
        m.distance(m.point(f"G{r}", generator.standard_normal(3) + 3, fixed=True), end)
        dof -= 1
    m.gravity((0.3, -0.5, -9.81))
    return m, dof


def _body(m, k, generator):
    frame = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    start = 2 * generator.standard_normal(3)
    points = [m.point(f"A{k}", start), m.point(f"B{k}", start + frame[0])]
    u = m.vector(f"u{k}", frame[1])
    extra = [m.vector(f"v{k}", frame[2])] if generator.random() < 0.5 else []
    tensor = np.diag(1 + 0.3 * generator.random(3))
    com = start + 0.2 * generator.standard_normal(3)
    return m.body(f"body{k}", points, [u, *extra], mass=1 + generator.random(), com=com, inertia=tensor), u


def _join(m, joint, parent, body, u, k, generator):
    fixed = parent is m.ground
    place = m.point(f"J{k}", 2 * generator.standard_normal(3), fixed=fixed)
    direction = generator.standard_normal(3)
    axis = m.vector(f"e{k}", direction / np.linalg.norm(direction), fixed=fixed)
    if joint == "spherical":
        m.spherical(parent, body, place)
        if not fixed:
            m.extend(parent, axis)
        return
    if joint == "revolute":
        m.revolute(parent, body, place, axis)
    else:
        m.universal(parent, body, place, axis, u)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(trees())
def test_random_mechanisms(tree):
    """Degrees of freedom as counted; Φ_q, γ, M and Q against what they are derivatives of."""
    model, dof = build(*tree)
    kernels = ncgen.compile(model, backend="numpy")
    found = ncgen.freedom(kernels)
    assert found.dof == dof
    assert np.max(np.abs(kernels.phi(kernels.q0))) < 1e-13
    generator = np.random.default_rng(1)
    q, v = kernels.q0 + 0.1 * generator.standard_normal(kernels.n), generator.standard_normal(kernels.n)
    eye = np.eye(kernels.n)
    jacobian = kernels.jacobian(q)
    by_step = kernels.phi(q + 1j * STEP * eye).imag.T / STEP
    assert np.max(np.abs(jacobian - by_step)) < 1e-14 * max(1, np.max(np.abs(jacobian)))
    change = kernels.jacobian(q + 1j * STEP * v).imag / STEP @ v
    assert np.allclose(kernels.gamma(q, v), -change, rtol=1e-12, atol=1e-12)
    mass = kernels.mass_matrix(q)
    assert np.array_equal(mass, mass.T)
    assert np.linalg.eigvalsh(mass)[0] > -1e-12 * np.max(np.abs(mass))
    assert np.isclose(kernels.energy(q, v)[0], v @ mass @ v / 2, rtol=1e-12)
    slope = kernels.energy(q + 1j * STEP * eye, v + 0 * eye)[:, 1].imag / STEP
    inertial = np.array([(v @ kernels.mass_matrix(q + 1j * STEP * e).imag @ v) / STEP / 2 for e in eye])
    carried = kernels.mass_matrix(q + 1j * STEP * v).imag / STEP @ v
    assert np.allclose(kernels.force(q, v), -slope + inertial - carried, rtol=1e-10, atol=1e-10)
