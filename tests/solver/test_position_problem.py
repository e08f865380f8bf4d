"""The position problem: closing a mechanism from a poor start, moving it through finite displacements, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ConvergenceError, ModelError, SingularError
from ncgen.solver.positions.position import move, residual, solve_position, sweep
from ncgen.solver.positions.rank import freedom


def shifted(kernels, amount, seed=0):
    return kernels.q0 + amount * np.random.default_rng(seed).normal(size=kernels.n)


@pytest.mark.parametrize("seed", range(5))
def test_robot_closes_from_a_poor_start(robot, robot_tables, seed):
    """All distances and right angles of the tables are back, redundant row or not, and quadratically so."""
    found = solve_position(robot, shifted(robot, 0.02, seed))
    assert found.residual == found.history[-1] <= 1e-12
    assert residual(robot, found.q) == found.residual
    assert found.iterations == len(found.history) - 1 <= 8
    names = {name.split(".")[0] for name in robot.coordinates[:30]}
    place = {name: found.q[[robot.index[f"{name}.{axis}"] for axis in "xyz"]] for name in names}
    for i, j in [(2, 3), (2, 4), (3, 5), (4, 5), (5, 6), (4, 6), (6, 7), (7, 8)]:
        length = np.linalg.norm(place[f"r{i}"] - place[f"r{j}"])
        assert length == pytest.approx(getattr(robot_tables, f"L{i}{j}"), rel=1e-11)
    for u, (i, j) in [("u3", (2, 4)), ("u3", (4, 5)), ("u3", (6, 7)), ("u4", (7, 8)), ("u5", (7, 8))]:
        assert place[u] @ (place[f"r{i}"] - place[f"r{j}"]) == pytest.approx(0.0, abs=1e-11)
        assert np.linalg.norm(place[u]) == pytest.approx(1.0, abs=1e-11)


def test_a_closed_position_is_left_alone(robot, spatial):
    """To the last bit: solving does no harm."""
    for q in (robot.q0, spatial.q[20], spatial.q[50]):
        found = solve_position(robot, q)
        assert np.array_equal(found.q, q)
        assert found.iterations == 0


def test_the_start_is_not_written_on(robot):
    start = shifted(robot, 0.02)
    copy = start.copy()
    solve_position(robot, start)
    move(robot, robot.q0, {"psi2": 0.1})
    assert np.array_equal(start, copy)


def test_held_coordinates_keep_their_bits(robot):
    """Six angles held: the rest follows, and there is one place for it near by."""
    held = tuple(f"psi{i}" for i in range(1, 7))
    start = shifted(robot, 0.01, 7)
    found = solve_position(robot, start, held=held)
    assert np.array_equal(found.q[30:], start[30:])
    again = solve_position(robot, found.q + 1e-3 * np.r_[np.ones(30), np.zeros(6)], held=held)
    assert again.q == pytest.approx(found.q, abs=1e-11)


def test_held_angles_determine_the_robot(robot, tree):
    """The position that belongs to six angles is the tree's."""
    psi = tree.start + [0.3, -0.4, 0.5, 0.9, -0.6, 1.2]
    found = move(robot, robot.q0, {f"psi{i}": value for i, value in enumerate(psi, 1)}, steps=4)
    for number, place in tree.points(tree.frames(psi, np.zeros(6))).items():
        if number > 1:
            where = [robot.index[f"r{number}.{axis}"] for axis in "xyz"]
            assert found.q[where] == pytest.approx(place.position, abs=1e-10)


def test_the_same_closure_on_both_backends(robot, robot_numpy):
    start = shifted(robot, 0.02, 11)
    assert solve_position(robot, start).q == pytest.approx(solve_position(robot_numpy, start).q, abs=1e-12)


# -- finite displacements -----------------------------------------------------------------------


def test_sweep_of_the_crank(fourbar, loop):
    """Two turns of the crank: B and C by the intersection of circles, and the angle counts on."""
    angles = np.linspace(0.0, 4 * np.pi, 33)
    path = sweep(fourbar, "psi", angles)
    assert path[:, fourbar.index["psi"]] == pytest.approx(angles, abs=0)
    expected = np.array([loop.places(angle).ravel() for angle in angles])
    where = [fourbar.index[name] for name in ("B.x", "B.y", "C.x", "C.y")]
    assert path[:, where] == pytest.approx(expected, abs=1e-11)


@pytest.mark.parametrize("turns", [-0.9, 0.4, 0.5, 0.9, 1.0])
def test_a_long_move_in_one_go(fourbar, loop, turns):
    """C stays above, and the angle is the one asked for: half a turn is no mirror root."""
    found = move(fourbar, fourbar.q0, {"psi": 2 * np.pi * turns})
    where = [fourbar.index[name] for name in ("B.x", "B.y", "C.x", "C.y", "psi")]
    assert found.q[where] == pytest.approx([*loop.places(2 * np.pi * turns).ravel(), 2 * np.pi * turns], abs=1e-11)


def test_sweep_of_nothing(fourbar):
    assert sweep(fourbar, "psi", []).shape == (0, fourbar.n)


def test_a_move_out_of_reach(fourbar):
    """C stays within a circle of 0.304 m around D; where it turns back on it, is reported."""
    with pytest.raises(ConvergenceError, match=r"^fourbar: C\.x = 10 is beyond a dead centre at C\.x = 0\.385") as refusal:
        move(fourbar, fourbar.q0, {"C.x": 10.0})
    assert refusal.value.history[-1] > 1e-12


def test_unknown_coordinates_are_named(fourbar):
    for refused in (lambda: move(fourbar, fourbar.q0, {"phi": 1.0}), lambda: sweep(fourbar, "phi", [1.0])):
        with pytest.raises(ModelError, match="the mechanism has no free coordinate phi; it has B.x, B.y, C.x, C.y, psi"):
            refused()


# -- refusals -----------------------------------------------------------------------------------


def triangle(side):
    """A triangle of three distances whose tip may not exist."""
    m = Model("triangle")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0), fixed=True)
    C = m.point("C", (0.5, 0.1))
    m.body("tip", [C], mass=1.0)
    m.distance(A, C, side)
    m.distance(B, C, 0.4)
    return ncgen.compile(m, "numpy")


def test_no_position_names_the_worst_row():
    """Sides 0.4 and 0.4 do not reach over 1: the best compromise leaves both rows violated, and one is named."""
    message = r"no convergence in 40 steps.*worst is row [12] \(distance [AB]-C, user model\)"
    with pytest.raises(ConvergenceError, match=message) as refusal:
        solve_position(triangle(0.4), [0.5, 0.1])
    assert len(refusal.value.history) == 41
    assert min(refusal.value.history) > 0.1


def test_a_position_that_exists_is_found():
    """Sides 0.8 and 0.4 over 1: x = (1 + 0.64 − 0.16)/2, y² = 0.64 − x²."""
    x = 0.74
    assert solve_position(triangle(0.8), [0.5, 0.1]).q == pytest.approx([x, np.sqrt(0.64 - x**2)], abs=1e-12)


def test_the_mirror_root_is_refused(fourbar):
    """sin(θ − ψ) vanishes half a turn off as well; that is not the angle."""
    q = fourbar.q0.copy()
    q[fourbar.index["psi"]] += np.pi
    assert residual(fourbar, q) < 1e-12
    with pytest.raises(ConvergenceError, match="angle psi: .* mirror root, 180.0 degrees off"):
        solve_position(fourbar, q)
    q[fourbar.index["psi"]] += np.pi
    assert np.array_equal(solve_position(fourbar, q).q, q)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_start_that_is_no_number(fourbar, value):
    q = fourbar.q0.copy()
    q[fourbar.index["C.y"]] = value
    for start in (lambda: solve_position(fourbar, q), lambda: ncgen.assemble(fourbar, q), lambda: ncgen.simulate(fourbar, 0.1, q0=q)):
        with pytest.raises(ModelError, match=f"^q0?: C.y is {value}; it must be a finite number$"):
            start()


def test_an_open_start_is_assembled_and_said(fourbar):
    """Moving B by 1 mm opens two rows; the simulation closes them and says what moved."""
    q = fourbar.q0.copy()
    q[fourbar.index["B.x"]] += 1e-3
    with pytest.warns(UserWarning, match="fourbar: the initial position was open and has been assembled; B.x moved most"):
        run = ncgen.simulate(fourbar, 0.01, q0=q, points=2)
    assert run.violation()[0] < 1e-11


# -- singular positions -------------------------------------------------------------------------


def parallelogram(height):
    """Bars of 1, 2 and 1 m over a ground of 2 m; height 0 lays it flat."""
    m = Model("parallelogram")
    x = np.sqrt(1 - height**2)
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (2, 0), fixed=True)
    B, C = m.point("B", (x, height)), m.point("C", (2 + x, height))
    m.body("left", [B], mass=1.0)
    m.body("right", [C], mass=1.0)
    m.distance(A, B)
    m.distance(B, C)
    m.distance(C, D)
    m.gravity((0, -9.81, 0))
    return ncgen.compile(m, "numpy")


def test_a_standing_parallelogram_is_regular():
    found = freedom(parallelogram(0.6))
    assert (found.rank, found.rank_here, found.dof, found.is_singular) == (3, 3, 1, False)


def test_a_flat_parallelogram_is_singular():
    """All bars on one line: the rows say nothing about y, so rank 2 of 3; what vanishes is a motion of B.y and C.y."""
    kernels = parallelogram(0.0)
    found = freedom(kernels)
    assert (found.rank, found.rank_here, found.dof, found.is_singular) == (3, 2, 1, True)
    assert found.redundant == ()
    (motion,) = found.vanishing.T
    assert kernels.coordinates == ("B.x", "B.y", "C.x", "C.y")
    assert motion[[0, 2]] == pytest.approx([0, 0], abs=1e-12)
    assert np.linalg.norm(motion) == pytest.approx(1.0)
    assert kernels.jacobian(kernels.q0) @ motion == pytest.approx(np.zeros(3), abs=1e-12)


def test_a_singular_start_is_refused():
    message = r"parallelogram: .* rank 2 where 3 is general; the extra motion moves [BC]\.y(, [BC]\.y)?;"
    with pytest.raises(SingularError, match=message):
        ncgen.simulate(parallelogram(0.0), 0.1, formalism="coordinate-partitioning")


def test_a_singular_start_is_told():
    """The default can go on from there, but not say on which branch."""
    with pytest.warns(UserWarning, match=r"parallelogram: .* rank 2 where 3 is general; .*; start from another position"):
        assert np.isfinite(ncgen.simulate(parallelogram(0.0), 0.1).q).all()


def test_a_dead_centre_has_one_direction():
    """Two bars stretched over their whole length: a structure, but for the middle's infinitesimal motion across."""
    m = Model("stretched")
    A, D = m.point("A", (0, 0), fixed=True), m.point("D", (2, 0), fixed=True)
    B = m.point("B", (1, 0))
    m.body("middle", [B], mass=1.0)
    m.distance(A, B)
    m.distance(B, D)
    kernels = ncgen.compile(m, "numpy")
    found = freedom(kernels)
    assert (found.rank, found.rank_here, found.dof) == (2, 1, 0)
    assert np.abs(found.vanishing) == pytest.approx(np.array([[0.0], [1.0]]), abs=1e-12)
    with pytest.raises(SingularError, match="moves B.y;"):
        ncgen.simulate(kernels, 0.1, formalism="coordinate-partitioning")


def test_the_robots_flat_parallelogram(robot, tree):
    """r3 − r2 = r5 − r4: bodies 2-3-5-4 fold flat where body 3 points along r3 − r2, one rank is lost there."""
    along = robot_parallelogram_angle(tree)
    psi = tree.start + [0, along, 0, 0, 0, 0]
    near = move(robot, robot.q0, {"psi2": psi[1] - 0.05}, steps=8).q
    assert not freedom(robot, near).is_singular
    flat = robot.q0.copy()
    for number, place in tree.points(tree.frames(psi, np.zeros(6))).items():
        if number > 1:
            flat[[robot.index[f"r{number}.{axis}"] for axis in "xyz"]] = place.position
    flat[30:] = psi
    found = freedom(robot, flat)
    assert (found.rank, found.rank_here, found.dof) == (30, 29, 6)
    with pytest.raises(SingularError, match="rank 29 where 30 is general"):
        ncgen.simulate(robot, 0.1, q0=flat, formalism="coordinate-partitioning")


def robot_parallelogram_angle(tree):
    """ψ2 that turns r4 − r2 (which starts along z) onto r3 − r2, about −x."""
    d = tree.r[3] - tree.r[2]
    return float(np.arctan2(d[1], d[2]))


# -- what should be, and is not yet -------------------------------------------------------------


def test_unknown_held_coordinates_are_named(fourbar):
    with pytest.raises(ModelError, match="phi"):
        solve_position(fourbar, fourbar.q0, held=("phi",))


def test_a_long_move_stays_on_its_branch(fourbar, loop):
    """From 1 rad to nearly 12 rad in one go; C is thrown below the line BD."""
    start = move(fourbar, fourbar.q0, {"psi": 1.0}, steps=20).q
    target = -6.2 + 18.7 * 145 / 149
    where = [fourbar.index[name] for name in ("C.x", "C.y")]
    assert move(fourbar, start, {"psi": target}).q[where] == pytest.approx(loop.places(target)[1], abs=1e-9)


def test_a_start_on_the_mirror_root_is_refused(fourbar):
    q = fourbar.q0.copy()
    q[fourbar.index["psi"]] += np.pi
    with pytest.raises((ModelError, ConvergenceError), match="psi"):
        ncgen.simulate(fourbar, 0.01, q0=q, points=2)
