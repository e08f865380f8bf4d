"""One body, many descriptions, one motion; and the paper's robot from bodies and joints instead of rows."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen

MASS, COM, TENSOR = 2.0, np.array([0.3, 0.1, -0.2]), np.array([[0.5, 0.02, 0.01], [0.02, 0.6, -0.03], [0.01, -0.03, 0.4]])
AT = {"A": (0, 0, 0), "B": (1, 0, 0), "C": (0.2, 0.8, 0), "D": (0.1, 0.3, 0.9)}
ALONG = {"u": (0, 1, 0), "v": (0, 0.6, 0.8)}
DESCRIPTIONS = {
    "2 points, 1 vector": (("A", "B"), ("u",), {}),
    "2 points, 1 vector, constant mass": (("A", "B"), ("u",), {"constant_mass": True}),
    "2 points, 2 vectors": (("A", "B"), ("u", "v"), {}),
    "3 points, 1 vector": (("A", "B", "C"), ("v",), {}),
    "4 points": (("A", "B", "C", "D"), (), {}),
    "3 points": (("A", "B", "C"), (), {}),
}


def spinning_pendulum(points, vectors, options):
    """A body hung at A by a spherical joint, swinging and spinning."""
    m = ncgen.Model("top")
    ps = [m.point(n, AT[n], fixed=n == "A") for n in points]
    us = [m.vector(n, ALONG[n]) for n in vectors]
    m.body("body", ps, us, mass=MASS, com=COM, inertia=TENSOR, **options)
    m.gravity((0, 0, -9.81))
    return ncgen.compile(m, backend="numpy")


def start(kernels, omega):
    """Velocities of a rotation about A."""
    from ncgen.solver.positions.partition import choose_partitions

    z = choose_partitions(kernels, kernels.q0).velocity.names(kernels)
    elements = kernels.model.elements
    rate = {}
    for element in elements.values():
        for axis, value in zip("xyz", np.cross(omega, element.initial), strict=True):
            rate[f"{element.name}.{axis}"] = value
    return {name: rate[name] for name in z}


@pytest.mark.parametrize("name", list(DESCRIPTIONS)[1:])
def test_descriptions_give_one_motion(name):
    """Point B moves alike however the body is described (against the first description, velocity-dependent inertia)."""
    paths = []
    for description in (list(DESCRIPTIONS)[0], name):
        kernels = spinning_pendulum(*DESCRIPTIONS[description])
        run = ncgen.simulate(
            kernels, 0.4, integrator="dop853", rtol=1e-10, atol=1e-12, points=5, zd0=start(kernels, np.array([1.0, -2.0, 3.0]))
        )
        assert run.energy_drift < 1e-9
        paths.append(run.point("B"))
    assert np.max(np.abs(paths[0] - paths[1])) < 1e-8


def robot_from_bodies(robot_tables):
    """The robot said as an engineer would: bodies with their elements, nothing else."""
    P, U, inertia = robot_tables.P, robot_tables.U, robot_tables.INERTIA
    m = ncgen.Model("robot")
    r = {i: m.point(f"r{i}", row[:3], fixed=i == 1) for i, row in enumerate(P, 1)}
    u = {i: m.vector(f"u{i}", row[:3], fixed=i <= 2) for i, row in enumerate(U, 1)}
    elements = {2: ((1, 2, 3), (1, 3)), 3: ((2, 4), (3,)), 4: ((3, 5), (3,)), 5: ((4, 5, 6), (3,)), 6: ((6, 7), (3,))}
    elements |= {7: ((6, 7), (4,)), 8: ((7, 8), (4,)), 9: ((7, 8), (5,))}
    for i, (points, vectors) in elements.items():
        entry = inertia[i]
        m.body(f"body{i}", [r[k] for k in points], [u[k] for k in vectors], entry["m"], entry["cog"], entry["IT"])
    psi = [
        m.angle("psi1", u[2], u[3], u[1]),
        m.angle("psi2", r[4] - r[2], u[1], u[3]),
        m.angle("psi3", r[4] - r[6], r[7] - r[6], u[3]),
        m.angle("psi4", u[3], u[4], r[7] - r[6]),
        m.angle("psi5", r[6] - r[7], r[8] - r[7], u[4]),
        m.angle("psi6", u[4], u[5], r[8] - r[7]),
    ]
    m.independent(*psi)
    m.gravity((0, 0, -9.81))
    return m


def test_robot_from_bodies_moves_like_the_tables(robot_tables, robot_numpy):
    """Rows chosen by ncgen and the paper's own rows give the same spatial motion to 1e-9."""
    mine = ncgen.compile(robot_from_bodies(robot_tables), backend="numpy")
    assert ncgen.freedom(mine).dof == 6
    rates = {"psi1": 1.0, "psi2": 0.5, "psi3": -0.7, "psi4": 1.2, "psi5": 0.3, "psi6": -2.0}
    runs = [ncgen.simulate(k, 0.1, integrator="dop853", rtol=1e-11, atol=1e-12, points=3, zd0=rates) for k in (mine, robot_numpy)]
    for name in rates:
        assert np.max(np.abs(runs[0][name] - runs[1][name])) < 1e-9


def test_planar_fourbar_costs_no_more_than_by_hand():
    """The emitted planar four-bar has no z, and Φ of its three bars needs no more than the nine-operation distance rows.

    By hand: (x₂−x₁)² + (y₂−y₁)² − L² scaled is 2 subtractions, 2 squares, 1 sum, 1 subtraction, 1 product = 7 operations
    (5 where one end is fixed at the origin); the angle row cos ψ·y − sin ψ·x over L is 2 products, 1 difference, 1 product
    and a sine and a cosine.
    """
    from ncgen.program.ir.cost import cost

    sources = ncgen.generate(ncgen.load("fourbar"), emission="unrolled")
    assert "_z" not in sources.c["fourbar.c"].split("int fourbar_phi(")[1]
    assert cost(sources.programs.programs["phi"]).total <= 5 + 7 + 7 + 6


def test_parameters_change_without_compiling(monkeypatch):
    """A length, a mass, a fixed point and a stiffness as parameters: changing p equals building with that number."""
    import subprocess

    def model(L, m0, x, k):
        m = ncgen.Model("params")
        values = {n: m.parameter(n, v) for n, v in zip(("L", "m0", "x", "k"), (L, m0, x, k), strict=True)}
        A = m.point("A", (values["x"], 0.0), fixed=True)
        B = m.point("B", (0.6, -0.8))
        m.body("bob", [B], mass=values["m0"])
        m.distance(A, B, values["L"])
        G = m.point("G", (2.0, 0.5), fixed=True)
        m.spring(B, G, values["k"], 0.3 * values["k"], 1.0)
        m.gravity((0, -9.81, 0))
        return m

    old, new = (1.0, 2.0, 0.0, 5.0), (1.1, 3.0, 0.05, 7.0)
    kernels, rebuilt = (ncgen.compile(model(*v)) for v in (old, new))
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: pytest.fail("a compiler was called"))
    q, qd, p = np.array([0.5, -0.7]), np.array([0.3, 0.4]), np.array(new)
    for kernel, arguments in [("phi", (q,)), ("gamma", (q, qd)), ("force", (q, qd)), ("energy", (q, qd))]:
        here = getattr(kernels, kernel)(*arguments, p=p)
        assert np.allclose(here, getattr(rebuilt, kernel)(*arguments), rtol=4e-16, atol=0)
    assert np.allclose(kernels.mass_matrix(q, p=p), rebuilt.mass_matrix(q), rtol=4e-16)
