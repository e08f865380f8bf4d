"""Base parameters: how many there are, what adds up to them, and what a noisy motion says they are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ncgen
from ncgen.exchange.examples import example_module

ARM = example_module("arm")
GRAVITY = np.array([0.0, 0.0, -9.81])
N = 7


@pytest.fixture(scope="module")
def identification():
    return example_module("robot", "identification.py")


def energies(turn, omega, place, velocity):
    """T and V of a body by its ten numbers [Jxx Jxy Jxz Jyy Jyz Jzz hx hy hz m] about a point of it, axes of the initial position."""
    w, v = turn.T @ omega, turn.T @ velocity
    kinetic = [w[i] * w[j] * (0.5 if i == j else 1.0) for i in range(3) for j in range(i, 3)]
    return np.array([
        [*kinetic, *np.cross(v, w), v @ v / 2],
        [*np.zeros(6), *-(turn.T @ GRAVITY), -GRAVITY @ place],
    ])  # fmt: skip


def arm_energies(angles, rates):
    """Of all links by all their numbers, (2, 70): products of rotations, no row and no coordinate of ncgen's."""
    turn, place, omega, velocity, found = np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3), []
    for i in range(N):
        omega = omega + turn @ ARM.axis(i) * rates[i]
        turn = turn @ Rotation.from_rotvec(angles[i] * ARM.axis(i)).as_matrix()
        found.append(energies(turn, omega, place, velocity))
        step = turn @ ARM.step(i)
        place, velocity = place + step, velocity + np.cross(omega, step)
    return np.hstack(found)


@pytest.mark.slow
def test_arm(identification):
    """43 for seven hinges, the first one vertical and the second at right angles to it: 7 N - 4 - 2 (Mayeda, Yoshida, Osuka 1990). Numbers
    with the same sums have the same energies, so the same motion; the energies' numerical rank is their number."""
    model, names = identification.with_moments(ncgen.load("arm"))
    base = identification.base_parameters(ncgen.compile(model, "numpy"), names)
    assert len(base.names) == 10 * N and len(base.kept) == 7 * N - 4 - 2
    assert base.gap > 1e6
    draw = np.random.default_rng(5)
    level = arm_energies(np.zeros(N), np.zeros(N))[1]
    seen = []
    for _ in range(80):
        kinetic, potential = arm_energies(draw.uniform(-1, 1, N), draw.standard_normal(N))
        seen += [kinetic, potential - level]  # a constant moves nothing
    seen = np.array(seen)
    sizes = np.linalg.svd(seen, compute_uv=False)
    assert sizes[len(base.kept) - 1] > 1e-6 * sizes[0] > 1e6 * sizes[len(base.kept)]
    np.testing.assert_allclose(seen[:, base.kept] @ base.sums, seen, rtol=0, atol=1e-8 * sizes[0])


@pytest.mark.slow
def test_robot(identification, capsys, tmp_path, monkeypatch):
    """38 for the robot with its parallelogram, by the rank of kinetic and potential energy of its bodies, whose velocities come from points
    and vectors alone; from a noisy motion all within four and a half standard deviations, and what is left is as large as the noise."""
    its = identification.experiment()
    kernels, base = its.kernels, its.base
    elements = kernels.model.elements
    draw = np.random.default_rng(6)
    partition = identification.choose_partition(kernels, kernels.q0, independent=its.z)
    seen, level = [], None
    for state in range(121):
        reach = 0.4 * draw.uniform(-1, 1, 6) * (state > 0)
        q = ncgen.move(kernels, None, {name: kernels.q0[kernels.index[name]] + x for name, x in zip(its.z, reach)}, steps=10).q
        qd = identification.kinematics(kernels, partition, q).R @ draw.standard_normal(6)

        def at(values, name, held):
            return np.array([held if c.fixed else values[kernels.index[c.name]] for c, held in zip(elements[name].components, held)])

        rows = []
        for body in kernels.model.bodies.values():
            if body.inertia is None:
                continue
            first = body.basis[0]
            before, now, rate = [], [], []
            for e in body.elements:
                start = np.array([c.initial for c in e.components])
                is_point = e in body.points
                before.append(start - (first.initial if is_point else 0.0))
                now.append(at(q, e.name, start) - (at(q, first.name, first.initial) if is_point else 0.0))
                rate.append(at(qd, e.name, np.zeros(3)) - (at(qd, first.name, np.zeros(3)) if is_point else 0.0))
            turn = Rotation.align_vectors(np.array(now), np.array(before))[0].as_matrix()
            crosses = np.vstack([np.cross(np.eye(3), x).T for x in now])  # omega x a = crosses omega
            omega = np.linalg.lstsq(crosses, np.concatenate(rate), rcond=None)[0]
            rows.append(energies(turn, omega, at(q, first.name, first.initial), at(qd, first.name, np.zeros(3))))
        kinetic, potential = np.hstack(rows)
        level = potential if level is None else level
        seen += [kinetic, potential - level]
    seen = np.array(seen)
    sizes = np.linalg.svd(seen, compute_uv=False)
    assert len(base.kept) == 38 and base.gap > 1e6
    assert sizes[37] > 1e-6 * sizes[0] > 1e4 * sizes[38]
    np.testing.assert_allclose(seen[:, base.kept] @ base.sums, seen, rtol=0, atol=1e-7 * sizes[0])

    found, _ = identification.identify(its)
    off = (found.x - kernels.p0[its.places]) / identification.deviations(found)
    assert np.max(np.abs(off)) < 4.5
    freedom = found.fun.size - len(off)
    assert abs(2 * found.cost - freedom) < 4 * np.sqrt(2 * freedom)
    monkeypatch.setattr(identification, "experiment", lambda: its)
    monkeypatch.setattr(identification.sys, "argv", ["script", "--plot", str(tmp_path / "plot.png")])
    identification.main()
    assert "80 inertial parameters make 38 base parameters" in capsys.readouterr().out
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")
