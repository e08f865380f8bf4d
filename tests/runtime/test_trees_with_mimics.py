"""Joints that follow others on trees in loops over tables: as the factored matrix has it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import null_space

import ncgen
from ncgen.mechanism.moving import Moving, Stepping
from ncgen.program.ir.blocks import Pattern
from ncgen.program.tree.couplings import NoTables, couplings, followed
from ncgen.solver.engines import acceleration_forms
from ncgen.solver.positions import rank
from ncgen.solver.positions.open_tree import open_tree
from ncgen.solver.positions.rank import freedom, scaled_jacobian
from ncgen.symbolic.tree import spanning_tree

LINK = """<link name="{0}"><inertial><origin xyz="0.02 0.01 {1}"/><mass value="{2}"/>
<inertia ixx="{3}" iyy="{4}" izz="{5}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4}" rpy="0.3 -0.2 0.1"/><axis xyz="{5}"/>
<dynamics damping="0.02"/>{6}<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""
MIMIC = '<mimic joint="{}" multiplier="{}" offset="{}"/>'

JOINTS = (
    ("arm", "revolute", "base", "upper", "0 0 0", "0 1 0", ""),
    ("turn", "revolute", "upper", "palm", "0 0 -0.4", "1 0 0", ""),
    ("first", "revolute", "palm", "finger", "0.05 0 -0.1", "0 0.6 0.8", ""),
    ("second", "revolute", "palm", "other", "-0.05 0 -0.1", "0.8 0 0.6", MIMIC.format("first", -1.5, 0.1)),
    ("sliding", "prismatic", "palm", "plate", "0 0.05 -0.1", "1 0 0", MIMIC.format("first", 0.03, 0.0)),
    ("knuckle", "revolute", "other", "tip", "0 0 -0.1", "0 1 0", MIMIC.format("second", 0.5, 0.0)),
    ("loose", "revolute", "tip", "pendant", "0 0 -0.05", "1 0 0", ""),
)


def written(folder, joints):
    """A robot's file of these joints."""
    links = ['<link name="base"/>']
    for k, (_, _, _, child, *_) in enumerate(joints):
        links.append(LINK.format(child, -0.05 - 0.02 * k, 1.0 / (1 + k), 0.02 / (1 + k) ** 2, 0.03 / (1 + k) ** 2, 0.025 / (1 + k) ** 2))
    path = folder / "gripper.urdf"
    path.write_text(f'<robot name="gripper">{"".join(links)}{"".join(JOINT.format(*joint) for joint in joints)}</robot>')
    return path


@pytest.fixture(scope="module")
def gripper(tmp_path_factory):
    return ncgen.compile(ncgen.load(written(tmp_path_factory.mktemp("robot"), JOINTS)), backend="c")


def moving(kernels, form):
    found = Moving(
        Stepping(acceleration_forms.all_coordinates(kernels, form=form), "dop853", freedom(kernels).rank, 1e-8, 1e-10, None, 1e-12)
    )
    found.p[:] = kernels.p0
    return found


def test_what_follows_is_seen(gripper):
    tree = open_tree(gripper)
    names = {screw: gripper.coordinates[c] for c, (screw, _) in tree.measured.items()}
    found = {names[k]: (names[leader], ratio) for k, (leader, ratio) in tree.coupled.leaders.items()}
    assert {leader for leader, _ in found.values()} == {"first"}
    assert {name: ratio for name, (_, ratio) in found.items()} == pytest.approx({"second": -1.5, "sliding": 0.03, "knuckle": -0.75})
    assert len(tree.coupled.carriers) == 1 and freedom(gripper).dof == 4


def test_joints_tell_the_rank(gripper, monkeypatch):
    """Of large trees, without a look at what rows imply."""
    found = freedom(gripper)
    monkeypatch.setattr(rank, "MIN_TREE_ROWS", 0)
    monkeypatch.setattr(rank, "freedom_at", None)
    assert rank.rank_at(gripper, gripper.q0, 0.0, gripper.p0) == (found.rank, found.is_singular) == (gripper.n - 4, False)


def test_accelerations_and_motion_are_those_of_the_matrix(gripper):
    states = {form: moving(gripper, form) for form in ("tree", "dense")}
    states["dense"].q[:] = gripper.q0
    states["dense"].qd[:] = np.random.default_rng(2).uniform(-1, 1, gripper.n) * gripper.column_sizes
    assert states["dense"].project_state() == "ok"
    states["tree"].q[:], states["tree"].qd[:] = states["dense"].q, states["dense"].qd
    for state in states.values():
        assert state.evaluate() == "ok"
    assert np.max(np.abs(states["dense"].qdd)) > 10.0
    assert states["tree"].qdd == pytest.approx(states["dense"].qdd, rel=1e-9, abs=1e-9)
    for state in states.values():
        assert state.go_on(0.3) == "ok"
        assert np.max(np.abs(gripper.phi(state.q) / gripper.row_sizes)) < 1e-13
    assert states["tree"].q == pytest.approx(states["dense"].q, abs=1e-7)
    assert states["tree"].qd == pytest.approx(states["dense"].qd, abs=1e-6)


def test_velocities_are_projected_with_the_least_kinetic_energy(gripper):
    """What joints allow of a change of velocities stays: T (Tᵀ M T)⁻¹ Tᵀ M of it, T spanning that."""
    q, sizes = ncgen.assemble(gripper), gripper.column_sizes
    T = sizes[:, None] * null_space(scaled_jacobian(gripper, q), rcond=1e-9)
    M, qd = gripper.mass(q).toarray(), np.random.default_rng(1).uniform(-1, 1, gripper.n) * sizes
    tree = moving(gripper, "tree")
    tree.q[:], tree.qd[:] = q, qd
    assert tree.project_state() == "ok"
    assert tree.qd == pytest.approx(T @ np.linalg.solve(T.T @ M @ T, T.T @ M @ qd), abs=1e-11)


def test_positions_follow_from_measured_joints(gripper):
    """Joints stay where they are, far from where the run began, too; links, and joints that follow, are where the constraints have them."""
    turned, rng = {"arm": 0.7, "turn": -1.1, "first": 0.4, "loose": 2.5}, np.random.default_rng(5)
    places = [gripper.coordinates.index(name) for name in turned]
    tree = moving(gripper, "tree")
    tree.q[:], tree.qd[:] = ncgen.assemble(gripper), 0.0
    for share in np.linspace(0.02, 1.0, 50):
        tree.q[:] += 1e-3 * rng.uniform(-1, 1, gripper.n) * gripper.column_sizes
        tree.q[places] = share * np.array(list(turned.values()))
        assert tree.project_state() == "ok"
        assert tree.q[places].tolist() == (share * np.array(list(turned.values()))).tolist()
        assert np.max(np.abs(gripper.phi(tree.q) / gripper.row_sizes)) < 5e-14


def test_the_written_out_run_takes_the_same_steps(gripper, monkeypatch):
    monkeypatch.setattr(acceleration_forms, "MOST_RATES", 0)
    tabled = ncgen.simulate(ncgen.compile(gripper.model, backend="c"), 1.0)
    monkeypatch.undo()
    emitted = ncgen.simulate(ncgen.compile(gripper.model, backend="c"), 1.0)
    assert (tabled.engine, emitted.engine) == ("tree", "emitted")
    assert tabled.statistics.fallbacks == 0
    assert tabled.statistics.evaluations == pytest.approx(emitted.statistics.evaluations, rel=0.02)
    assert np.max(np.abs(tabled.q[-1] - emitted.q[-1]) / gripper.column_sizes) < 1e-7


def test_a_group_with_two_carriers_has_no_tables(tmp_path):
    """A joint at the tip that follows one at the root moves more than one body between them."""
    joints = (*JOINTS[:6], (*JOINTS[6][:6], MIMIC.format("arm", 1.0, 0.0)))
    kernels = ncgen.compile(ncgen.load(written(tmp_path, joints)), backend="c")
    assert open_tree(kernels) is None
    with pytest.raises(NoTables, match="several bodies"):
        couplings(spanning_tree(kernels.model), {6: (0, 1.0)})


@pytest.mark.parametrize(
    ("rows", "values", "words"),
    [
        ([(0, 1, 2)], [[1.0, 1.0, 1.0]] * 2, "loops"),
        ([(0, 1)], [[1.0, 2.0], [1.0, 2.1]], "constant"),
        ([(0, 2), (1, 2)], [[1.0, 2.0, 1.0, 2.0]] * 2, "constant"),
    ],
)
def test_rows_that_say_more_are_refused(rows, values, words):
    starts = np.cumsum([0, *map(len, rows)]).tolist()
    pattern = Pattern((len(rows), 3), tuple(starts), tuple(c for row in rows for c in row))
    with pytest.raises(NoTables, match=words):
        followed(rows, pattern, np.array(values), {c: (c, 1.0) for c in range(3)})


def test_one_position_with_other_velocities(gripper):
    """Pushes of a group alone, where its momenta and pivots are known: as where nothing was evaluated before."""
    rng, tree, dense = np.random.default_rng(7), moving(gripper, "tree"), moving(gripper, "dense")
    for _ in range(3):
        dense.q[:], dense.qd[:] = ncgen.assemble(gripper), rng.uniform(-1, 1, gripper.n) * gripper.column_sizes
        assert dense.project_state() == "ok"
        fresh = moving(gripper, "tree")
        for state in (tree, fresh, dense):
            state.q[:], state.qd[:] = dense.q, dense.qd
            assert state.evaluate() == "ok"
        assert tree.qdd == pytest.approx(fresh.qdd, abs=1e-12 * np.max(np.abs(fresh.qdd)))
        assert tree.qdd == pytest.approx(dense.qdd, abs=1e-9)


def test_an_implicit_method_moves_groups_by_their_first_joint(gripper, monkeypatch):
    """Radau in the degrees of freedom of joints that follow none: the motion of the explicit method, with few Jacobians."""
    monkeypatch.setattr(acceleration_forms, "MOST_RATES", 0)
    start = {"arm": 0.5, "turn": -0.4}
    start = {name: start.get(name, 0.0) for name in gripper.model.chosen_independent}
    run = ncgen.simulate(gripper, 0.5, rtol=1e-7, points=3, zd0=start, integrator="radau")
    exact = ncgen.simulate(gripper, 0.5, rtol=1e-11, points=3, zd0=start, integrator="dop853")
    assert (run.engine, exact.engine) == ("tree", "tree")
    assert run.statistics.jacobians < run.statistics.steps / 5
    assert np.max(np.abs(run.q - exact.q) / gripper.column_sizes) < 1e-5


@pytest.mark.parametrize("mimic", ["", MIMIC.format("left", -1.5, 0.0)])
def test_the_inertia_of_trees_that_hang_apart_is_that_of_all_of_them(tmp_path, mimic):
    """The least eigenvalue of the mass matrix of the joints, scaled to a diagonal of 1, as a null space of the constraints has it."""
    joints = (
        ("left", "revolute", "base", "upper", "0 0 0", "0 1 0", ""),
        ("elbow", "revolute", "upper", "lower", "0 0 -0.4", "1 0 0", ""),
        ("right", "revolute", "base", "other", "1 0 0", "0 1 0", mimic),
        ("wrist", "revolute", "other", "hand", "0.05 0 -0.1", "0 0.6 0.8", ""),
        ("alone", "revolute", "base", "third", "2 0 0", "1 0 0", ""),
    )
    kernels = ncgen.compile(ncgen.load(written(tmp_path, joints)), backend="numpy")
    tree, masses = open_tree(kernels), kernels.values("mass", 0.0, kernels.q0, None, kernels.p0)
    allowed = null_space(kernels.phi_q(kernels.q0).toarray())
    free = [kernels.coordinates.index(name) for name, *_, follows in joints if not follows]
    moved = allowed @ np.linalg.inv(allowed[free])
    inertia = moved.T @ kernels.mass_pattern.dense(masses) @ moved
    sizes = np.sqrt(np.diag(inertia))
    expected = np.linalg.eigvalsh(inertia / np.outer(sizes, sizes))[0]
    assert tree.least_inertia(kernels.q0, kernels.mass_pattern, masses) == pytest.approx(expected, rel=1e-9)
