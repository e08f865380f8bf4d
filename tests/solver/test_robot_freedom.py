"""What the robot's Jacobian knows: degrees of freedom, the one redundancy, and the paper's rule of sines and cosines."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.solver.positions.branches import one_kind, refresh_branches
from ncgen.solver.positions.position import solve_position
from ncgen.solver.positions.rank import RELATIVE_ZERO, freedom

CHAIN = (5, 9, 11, 15)
"""Rows 6, 10, 12 and 16 counted from 1: u3 against r2-r3, r2-r4, r3-r5 and r4-r5, a closed planar chain."""


def numerical_rank(jacobian):
    """Rank by singular values."""
    values = np.linalg.svd(jacobian, compute_uv=False)
    return np.count_nonzero(values > RELATIVE_ZERO * values[0])


@pytest.fixture(scope="module")
def raw(robot_tables):
    """The paper's raw rows."""
    return ncgen.compile(robot_tables.build(scale=False), "numpy")


def rank(jacobian):
    """Rank by singular values, with a gap of six digits above the rounding."""
    values = np.linalg.svd(jacobian, compute_uv=False)
    return int(np.sum(values > 1e-9 * values[0]))


def test_counts(robot):
    """The paper's section 3: 45 coordinates, 9 of them fixed, 25 rigid-body rows of which 24 count, 6 angles."""
    found = freedom(robot)
    assert len(robot.model.components) == 45
    assert (robot.n, robot.m) == (36, 31)
    assert (found.rank, found.dof, found.is_singular) == (30, 6, False)
    assert found.vanishing.shape == (36, 0)
    assert rank(robot.jacobian(robot.q0)[:25, :30]) == 24


def test_singular_values_of_the_raw_rigid_rows(raw):
    """From 3.74 down to 0.148, then rounding: worked out by hand for the paper's tables before this program was."""
    values = np.linalg.svd(raw.jacobian(raw.q0)[:25, :30], compute_uv=False)
    assert values[0] == pytest.approx(3.74, abs=5e-3)
    assert values[23] == pytest.approx(0.148, abs=5e-4)
    assert values[24] < 1e-14


@pytest.mark.parametrize("scale", [True, False])
def test_redundancy_is_the_planar_chain(robot_tables, scale):
    """S(3;4,5) = S(3;2,3) − S(3;2,4) + S(3;3,5); a scaled row is S/L, so its coefficients are ratios of lengths."""
    kernels = ncgen.compile(robot_tables.build(scale=scale), "numpy")
    (redundant,) = freedom(kernels).redundant
    assert (redundant.row, *sorted(redundant.implied_by)) == (15, 5, 9, 11)
    assert [kernels.rows[i].code for i in CHAIN] == [1002] * 4
    lengths = np.array([getattr(robot_tables, name) for name in ("L23", "L24", "L35")]) if scale else np.ones(3)
    expected = lengths * (1, -1, 1) / (robot_tables.L45 if scale else 1.0)
    assert [redundant.implied_by[i] for i in (5, 9, 11)] == pytest.approx(expected, rel=1e-12)


def test_the_identity_holds_everywhere(raw):
    """S(3;2,4) − S(3;2,3) + S(3;4,5) − S(3;3,5) ≡ 0, with S(k;i,j) = u_k·(r_i − r_j), at consistent and other positions."""
    rng = np.random.default_rng(3)
    for q, qd in rng.normal(size=(20, 2, raw.n)):
        r = {i: q[[raw.index[f"r{i}.{axis}"] for axis in "xyz"]] for i in (2, 3, 4, 5)}
        u3 = q[[raw.index[f"u3.{axis}"] for axis in "xyz"]]
        segments = np.array([u3 @ (r[i] - r[j]) for i, j in [(2, 3), (2, 4), (3, 5), (4, 5)]])
        assert raw.phi(q)[list(CHAIN)] == pytest.approx(segments, abs=1e-14)
        for values in (raw.phi(q), raw.jacobian(q), raw.gamma(q, qd)):
            one, two, three, four = values[list(CHAIN)]
            assert np.max(np.abs(two - one + four - three)) < 1e-13


def test_rank_at_random_consistent_positions(robot):
    """30 everywhere but where something special happens, which random positions avoid."""
    rng = np.random.default_rng(4)
    for _ in range(6):
        q = solve_position(robot, robot.q0 + 0.02 * rng.normal(size=robot.n)).q
        assert rank(robot.jacobian(q)) == 30
        assert freedom(robot, q).rank_here == 30


@pytest.mark.parametrize("angles", ["ANGLES", "PRINTED_ANGLES"])
def test_the_papers_own_start_needs_its_rule(robot_tables, angles):
    """ψ1 and ψ6 start at ±90°, where a sine row says nothing, ψ2 and ψ4 at 0°, where a cosine row says nothing: 28 of 30."""
    kernels = ncgen.compile(robot_tables.build(angles=getattr(robot_tables, angles), form="paper"), "numpy")

    def rank_with(p):
        return numerical_rank(kernels.jacobian(kernels.q0, p=p))

    assert rank_with(one_kind(kernels, kernels.q0, kernels.p0, "sine")) == 28
    assert rank_with(one_kind(kernels, kernels.q0, kernels.p0, "cosine")) == 28
    assert rank_with(kernels.p0) == 30
    smooth = ncgen.compile(robot_tables.build(angles=getattr(robot_tables, angles)), "numpy")
    assert numerical_rank(smooth.jacobian(smooth.q0)) == 30


def test_branches_follow_the_rule(robot_tables):
    """Cosine where |sin ψ| > √½, else the component along the axis' largest; p comes back new, the old one untouched."""
    kernels = ncgen.compile(robot_tables.build(form="paper"), "numpy")
    rng = np.random.default_rng(5)
    for _ in range(10):
        q = kernels.q0 + 0.3 * rng.normal(size=kernels.n)
        psi = q[30:] = rng.uniform(-7, 7, 6)
        point = {i: q[[kernels.index[f"r{i}.{a}"] for a in "xyz"]] for i in (6, 7, 8)}
        u3, u4 = (q[[kernels.index[f"{u}.{a}"] for a in "xyz"]] for u in ("u3", "u4"))
        axes = [(0, 0, 1), u3, u3, point[7] - point[6], u4, point[8] - point[7]]
        chosen = [0 if np.sin(x) ** 2 > 0.5 else 1 + np.argmax(np.abs(n)) for x, n in zip(psi, axes, strict=True)]
        before = kernels.p0.copy()
        p = refresh_branches(kernels, q, kernels.p0)
        assert np.array_equal(p.reshape(6, 4), np.eye(4)[chosen])
        assert np.array_equal(kernels.p0, before)
