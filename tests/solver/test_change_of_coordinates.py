"""Independent coordinates give way to others where they become bad, in runs and in derivatives of motions, however rows are scaled."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.solver.positions import partition as choices
from ncgen.solver.positions.partition import Partition, PartitionsAt, choose_partitions
from ncgen.solver.positions.partition_watch import PartitionWatch

TURN, RATE, DURATION = 2.5, 3.0, 2.0
"""The angle (rad) at the start of a free pendulum of 1 m, its rate (rad/s), and the length of the motion (s): a whole turn, nearly."""


def free_pendulum(share: float = 1.0, **options) -> Model:
    """A point mass on a rod, without gravity, beside a point on a line that is told times a small share."""
    model = Model("free", **options)
    A = model.point("A", (0, 0), fixed=True)
    B = model.point("B", (np.cos(TURN), np.sin(TURN)))
    C = model.point("C", (0, 0), fixed="y")
    model.distance(A, B)
    model.body("bob", points=[B], mass=2.0)
    model.body("slide", points=[C], mass=1.0)
    model.constrain(share * C.x)
    return model


def at(t, turn=TURN, rate=RATE):
    """B at times (s)."""
    return np.column_stack([np.cos(turn + rate * t), np.sin(turn + rate * t)])


@pytest.fixture(scope="module", params=["numpy", "c"])
def kernels(request):
    return ncgen.compile(free_pendulum(1e-5), backend=request.param)


@pytest.fixture
def counted(monkeypatch):
    """How often coordinates were chosen, and rows differentiated, for partitions."""
    counts = Counter()

    def watch(name):
        function = getattr(choices, name)

        def counting(*arguments):
            counts[name] += 1
            return function(*arguments)

        monkeypatch.setattr(choices, name, counting)

    watch("column_order")
    watch("scaled_jacobian")
    return counts


def pendulum_at(kernels, angle):
    """The partitions where the free pendulum is at an angle (rad)."""
    q = np.zeros(kernels.n)
    q[[kernels.index["B.x"], kernels.index["B.y"]]] = np.cos(angle), np.sin(angle)
    return PartitionsAt(kernels, q)


@pytest.mark.parametrize("angle", [0.3, 1e-3])
def test_quality_is_one_over_the_growth_of_errors(kernels, angle):
    """With x alone independent, R = [1; −x/y; 0] on the unit circle, so 1/‖R‖ = |y|; the other row says nothing of it."""
    i = kernels.index
    partition = Partition(np.arange(2), np.sort([i["B.y"], i["C.x"]]), np.array([i["B.x"]]))
    assert pendulum_at(kernels, angle).quality(partition) == pytest.approx(np.sin(angle), rel=1e-9)


def test_others_are_looked_for_where_the_present_ones_are_bad(kernels, counted):
    """The quality is |y| with x independent, and |x| with y: both are 0.71 at π/4, where looking for others finds nothing better."""
    above = pendulum_at(kernels, np.pi / 2)
    x = above.choose_both()
    assert x.position.names(kernels) == ("B.x",)
    watch, found, begun = PartitionWatch(above, x), [], counted["column_order"]
    for degrees in (60, 44, 43, 38, 32, 90, 46, 44, 30):
        better = watch.better(pendulum_at(kernels, np.radians(degrees)), x)
        found.append((counted["column_order"] - begun, better and better.position.names(kernels)))
    assert found == [(0, None), *[(1, None)] * 6, (2, None), (3, ("B.y",))]


def test_what_partitions_share_is_computed_once(kernels, counted):
    x = pendulum_at(kernels, np.pi / 2).choose_both()
    counted.clear()
    here = pendulum_at(kernels, 0.3)
    better, possible = here.better(x)
    assert (here.worth(x), here.worth(better), possible) == pytest.approx((np.sin(0.3), np.cos(0.3), np.cos(0.3)))
    assert counted == {"column_order": 1, "scaled_jacobian": 1}


def test_a_run_looks_for_others_twice(counted):
    """It begins with y, whose quality |x| is 1 there. From 0.7 on y is bad, but x is clearly better only after eight more steps."""
    kernels = ncgen.compile(free_pendulum(1e-5), backend="c")
    start = {"q0": {"B.x": -1.0, "B.y": 0.0}, "zd0": {"B.y": -RATE}, "z": ("B.y",)}
    counted.clear()
    run = ncgen.simulate(kernels, 0.5, formalism="coordinate-partitioning", integrator="lsoda", max_step=0.005, **start)
    assert run.statistics.partition_changes == 1
    assert counted["column_order"] == 2


def test_a_run_changes_them(kernels):
    """By equal steps of rk4, whose error is that of θ̇ h⁵: with coordinates that are not changed it is that of their growth."""
    start = {"q0": {"B.x": np.cos(TURN), "B.y": np.sin(TURN)}, "zd0": {"B.y": RATE * np.cos(TURN)}}
    run = ncgen.simulate(kernels, DURATION, formalism="coordinate-partitioning", integrator="rk4", max_step=0.01, points=41, **start)
    assert run.statistics.partition_changes >= 3
    assert run.q[:, [kernels.index["B.x"], kernels.index["B.y"]]] == pytest.approx(at(run.t), abs=2e-6)


def test_derivatives_go_along():
    """x(T) = cos(θ₀ + ω T) where θ₀ and ω follow from y and ẏ at the start: in closed form by these, to the error of the steps."""
    kernels = ncgen.compile(free_pendulum(1e-5), backend="numpy")
    y, yd = np.sin(TURN), RATE * np.cos(TURN)
    given = {"zd0": {"B.y": yd}, "z": ("B.y",)}
    index, ends = kernels.index["B.x"], []

    def objective(q, qd):
        ends[:] = [q[-1], qd[-1]]
        by_q = np.zeros_like(q)
        by_q[-1, index] = 1.0
        return q[-1, index], by_q, None

    found = ncgen.gradient(kernels, DURATION, 400, objective, **given)
    angle_by_y, rate_by_y, rate_by_yd = 1 / np.cos(TURN), yd * y / np.cos(TURN) ** 3, 1 / np.cos(TURN)
    slope = -np.sin(TURN + RATE * DURATION)
    expected = {"B.y": slope * (angle_by_y + rate_by_y * DURATION), "rate(B.y)": slope * rate_by_yd * DURATION}
    assert found.value == pytest.approx(np.cos(TURN + RATE * DURATION), abs=1e-7)
    assert {name: found.derivatives[name] for name in expected} == pytest.approx(expected, rel=1e-6)
    forward = ncgen.sensitivities(kernels, DURATION, 400, by=("B.y", "rate(B.y)"), **given)
    assert forward.q_by[-1, index] == pytest.approx([found.derivatives["B.y"], found.derivatives["rate(B.y)"]], rel=1e-10)


def tethered_body() -> Model:
    """A body on a rod from the ground to one of its points, without forces: six joint velocities and one row."""
    model = Model("tethered")
    A = model.point("A", (0, 0, 0), fixed=True)
    B, C = model.point("B", (1.0, 0.0, 0.0)), model.point("C", (1.0, 1.0, 0.2))
    u, v = model.vector("u", (0, 0, 1)), model.vector("v", (1, 0, 0))
    model.body("b", points=[B, C], vectors=[u, v], mass=1.0, com=(1.0, 0.8, 0.1), inertia=np.diag([0.2, 0.25, 0.3]))
    model.distance(A, B)
    return model


@pytest.mark.parametrize("rows", [False, True], ids=["one", "many"])
def test_small_pivots_multiply_no_errors_of_steps(rows):
    """The rod turns to where the velocity that its row determines has no part in it. Steps by such pivots gained 30 % of the energy and
    ended 0.5 m from where the body is, without a word. Without forces the energy is what it was."""
    kernels = ncgen.compile(tethered_body(), backend="c")
    turning, moving = np.array([-1.19, 1.26, 2.08]), np.array([0.0, 2.06, 3.64])
    levers = {"B": (0, 0, 0), "C": (0, 1, 0.2), "u": (0, 0, 1), "v": (1, 0, 0)}
    rates = {name: np.cross(turning, lever) + (moving if name in "BC" else 0.0) for name, lever in levers.items()}
    qd0 = {c: rates[c[0]]["xyz".index(c[-1])] for c in kernels.coordinates}
    energies = []

    def objective(q, qd):
        energies.append([kernels.energy(*state)[0] for state in zip(q, qd, strict=True)])
        return 0.0, None, None

    if rows:
        z = choose_partitions(kernels, kernels.q0).velocity.names(kernels)
        many = {"q0": np.tile(kernels.q0, (2, 1)), "zd0": np.tile([qd0[name] for name in z], (2, 1)), "z": z}
        ncgen.gradient(kernels, 1.0, 40, objective, **many)
    else:
        ncgen.gradient(kernels, 1.0, 40, objective, qd0=qd0)
    assert len(energies) == (2 if rows else 1)
    for energy in energies:
        assert energy == pytest.approx(np.full(41, energy[0]), rel=5e-3)
