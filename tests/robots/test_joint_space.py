"""Joint space: mass matrix, forces, inverse and forward dynamics and Jacobians, beside Pinocchio and beside natural coordinates."""

import json
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.errors import ConvergenceError, ModelError, SingularError
from ncgen.solver.frames import transformation

HERE = Path(__file__).parent
STATES = json.loads((HERE / "crane.json").read_text())["states"]
"""What Pinocchio says (by_pinocchio.py)."""


@pytest.fixture(scope="module", params=["numpy", "c"])
def cranes(request):
    """{floating: joint space} of the crane."""
    return {
        floating: ncgen.joint_space(ncgen.compile(ncgen.load(HERE / "crane.urdf", floating=floating), request.param))
        for floating in (False, True)
    }


def placed(space, record):
    """The position of a record, and the order of its rates."""
    base = (record["turn"], record["shift"]) if record["floating"] else None
    names = [name for name in space.rates if "." in name] + record["joints"]
    return space.position(record["values"], base), np.array([names.index(name) for name in space.rates])


def close(found, expected):
    expected = np.asarray(expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * (1 + np.max(np.abs(expected))))


@pytest.mark.parametrize("record", STATES)
def test_everything_equals_pinocchio(cranes, record):
    space = cranes[record["floating"]]
    q, order = placed(space, record)
    v, a, forces = (np.array(record[name])[order] for name in ("v", "a", "forces"))
    close(space.kernels.phi(q), np.zeros(space.kernels.m))
    close(space.mass_matrix(q), np.array(record["mass"])[np.ix_(order, order)])
    close(space.gravity(q), np.array(record["gravity"])[order])
    close(space.inverse_dynamics(q, v), np.array(record["bias"])[order])
    close(space.coriolis(q, v), (np.array(record["bias"]) - record["gravity"])[order])
    close(space.inverse_dynamics(q, v, a), np.array(record["inverse"])[order])
    # forces of the model's own, here the damping of a joint, are beside those of Pinocchio
    close(space.forward_dynamics(q, v, forces - space.loads(q, v)), np.array(record["forward"])[order])
    damping = np.zeros(space.n)
    damping[space.rates.index("roll")] = -0.7 * v[space.rates.index("roll")]
    close(space.loads(q, v), damping)


@pytest.mark.parametrize("record", STATES)
def test_jacobian_of_a_frame_equals_pinocchio(cranes, record):
    space = cranes[record["floating"]]
    q, order = placed(space, record)
    close(q[[space.kernels.index[f"r_swing.{axis}"] for axis in "xyz"]], record["place"])
    jacobian = space.jacobian("r_swing", q, body="hook")
    close(jacobian, np.array(record["jacobian"])[:, order])
    close(space.jacobian("r_swing", q, body="hook", frame="spatial"), np.array(record["spatial"])[:, order])
    local = space.jacobian("r_swing", q, body="hook", frame="local")
    for half in (slice(0, 3), slice(3, 6)):
        turn = local[half] @ np.linalg.pinv(jacobian[half])
        close(turn @ jacobian[half], local[half])
    close(np.linalg.norm(local, axis=0), np.linalg.norm(jacobian, axis=0))


@pytest.mark.parametrize("record", STATES)
def test_momentum_and_energy_equal_pinocchio(cranes, record):
    """Of the fixed crane without its base, which Pinocchio takes for ground, too."""
    space = cranes[record["floating"]]
    q, order = placed(space, record)
    v = np.array(record["v"])[order]
    close(space.centre_of_mass(q), record["centre"])
    close(space.centre_of_mass_jacobian(q), np.array(record["centre_jacobian"])[:, order])
    close(space.momentum(q, v), record["momentum"])
    close(space.momentum_matrix(q) @ v, record["momentum"])
    about = np.array([0.3, -0.2, 0.5])
    moved = np.array(record["momentum"])
    moved[3:] += np.cross(np.array(record["centre"]) - about, moved[:3])
    close(space.momentum(q, v, about), moved)
    close(space.kinetic_energy(q, v), record["kinetic"])
    close(space.potential_energy(q), record["potential"])


@pytest.mark.parametrize("record", [record for record in STATES if not record["floating"]])
def test_slopes_equal_pinocchio(cranes, record):
    space = cranes[False]
    q, order = placed(space, record)
    v, a, forces = (np.array(record[name])[order] for name in ("v", "a", "forces"))
    found = space.inverse_dynamics_derivatives(q, v, a)
    for part, expected in zip(found, (*record["inverse_slopes"], record["mass"]), strict=True):
        close(part, np.array(expected)[np.ix_(order, order)])
    found = space.forward_dynamics_derivatives(q, v, forces - space.loads(q, v))
    damped = np.zeros((space.n, space.n))  # by the model's own damper, which Pinocchio's equations have not
    damped[:, space.rates.index("roll")] = -0.7 * found.force[:, space.rates.index("roll")]
    for part, expected in zip((found.position, found.rate - damped, found.force), record["forward_slopes"], strict=True):
        close(part, np.array(expected)[np.ix_(order, order)])


@pytest.mark.parametrize("name", ["arm", "doublependulum"])
def test_mass_and_forces_are_those_of_natural_coordinates(name):
    """M over the joints is Tᵀ M T with q̇ = T v, and T's columns are what velocities gives."""
    kernels = ncgen.compile(ncgen.load(name), "numpy")
    space = ncgen.joint_space(kernels)
    rng = np.random.default_rng(3)
    q = space.position(dict(zip(space.rates, rng.uniform(-2, 2, space.n), strict=True)))
    T = space.velocities(q, np.eye(space.n)).T
    assert np.max(np.abs(kernels.phi(q) / kernels.row_sizes)) < 1e-13
    assert np.max(np.abs(kernels.jacobian(q) @ T)) < 1e-12
    close(space.mass_matrix(q), T.T @ kernels.mass_matrix(q) @ T)
    close(space.loads(q) - space.gravity(q), T.T @ kernels.force(q, np.zeros(kernels.n)))
    v = rng.normal(size=space.n)
    partial = ncgen.simulate(kernels, 1e-3, q0=q, qd0=space.velocities(q, v), points=2, rtol=1e-12)
    moved = np.linalg.lstsq(space.velocities(partial.q[-1], np.eye(space.n)).T, partial.qd[-1], rcond=None)[0]
    middle = space.forward_dynamics(q, v)
    np.testing.assert_allclose((moved - v) / 1e-3, middle, rtol=0, atol=2e-2 * np.max(np.abs(middle)))


def test_inverse_kinematics_reaches_what_can_be_reached(cranes):
    """A place and a rotation that some joint values give are found again, from other values; a place far away is refused."""
    space = cranes[False]
    wanted = space.position({"slew": 0.5, "roll": 0.2, "luff": -0.4, "travel": 0.15, "swing": 0.3})
    place = wanted[[space.kernels.index[f"r_swing.{axis}"] for axis in "xyz"]]
    found = space.position(space.inverse_kinematics("r_swing", place))
    close(found[[space.kernels.index[f"r_swing.{axis}"] for axis in "xyz"]], place)
    turn = transformation(space.kernels, "trolley", wanted)
    both = space.position(space.inverse_kinematics("r_swing", place, turn, "trolley", start={"slew": 0.3}))
    close(both[[space.kernels.index[f"r_swing.{axis}"] for axis in "xyz"]], place)
    close(transformation(space.kernels, "trolley", both), turn)
    with pytest.raises(ConvergenceError, match=r"crane: r_roll does not get there, [\d.]+ m are left; begin elsewhere"):
        space.inverse_kinematics("r_roll", (5.0, 0.0, 0.0))


def test_the_centre_of_mass_is_what_weight_says(cranes):
    """V = −m g · c for gravity along the axes, one after the other, with the whole mass by hand."""
    model = ncgen.load(HERE / "crane.urdf")
    space = cranes[False]
    q = space.position({"slew": 0.7, "luff": 0.3, "travel": 0.2, "balance": -0.5})
    mass = 3 + 2 + 0.4 + 1.5 + 0.8 + 4
    heights = []
    for axis in np.eye(3):
        model.gravity(tuple(-axis))
        heights.append(ncgen.compile(model, "numpy").energy(q, np.zeros(len(q)))[1] / mass)
    close(space.centre_of_mass(q), heights)


def test_a_joint_that_moves_nothing_is_told(tmp_path):
    """The hook without its inertia: its swing has no acceleration."""
    text = (HERE / "crane.urdf").read_text().replace('<mass value="0.8"/>', '<mass value="0"/>')
    text = text.replace('<inertia ixx="0.006" ixy="0" ixz="0" iyy="0.006" iyz="0" izz="0.0004"/>', '<inertia ixx="0" iyy="0" izz="0"/>')
    (tmp_path / "crane.urdf").write_text(text)
    space = ncgen.joint_space(ncgen.compile(ncgen.load(tmp_path / "crane.urdf"), "numpy"))
    with pytest.raises(SingularError, match="crane: a joint moves nothing that has inertia; give its bodies mass"):
        space.forward_dynamics(space.kernels.q0)


def test_many_states_at_a_time():
    space = ncgen.joint_space(ncgen.compile(ncgen.load("arm"), "numpy"))
    rng = np.random.default_rng(5)
    states = np.array([space.position(dict(zip(space.coordinates, rng.uniform(-1, 1, 7), strict=True))) for _ in range(6)]).reshape(
        2, 3, -1
    )
    v = rng.normal(size=(2, 3, 7))
    together = space.mass_matrix(states), space.inverse_dynamics(states, v), space.jacobian("r7", states)
    slopes, momentum = space.forward_dynamics_derivatives(states, v), space.momentum(states, v)
    for i, j in np.ndindex(2, 3):
        close(together[0][i, j], space.mass_matrix(states[i, j]))
        close(together[1][i, j], space.inverse_dynamics(states[i, j], v[i, j]))
        close(together[2][i, j], space.jacobian("r7", states[i, j]))
        close(momentum[i, j], space.momentum(states[i, j], v[i, j]))
        for part, alone in zip(slopes, space.forward_dynamics_derivatives(states[i, j], v[i, j]), strict=True):
            np.testing.assert_allclose(part[i, j], alone, rtol=0, atol=1e-10 * np.max(np.abs(alone)))


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda s: s.position({"elbow": 1.0}), "values: the mechanism has no joint elbow; it has psi1"),
        (lambda s: s.position(base=(np.eye(3), np.zeros(3))), "arm: base given, but 0 bodies move freely; it needs one"),
        (lambda s: s.mass_matrix(np.zeros(3)), "q: its shape is (3,), and arm has 49 coordinates; give (…, 49)"),
        (lambda s: s.jacobian("tip", s.kernels.q0), "point: there is no tip; the points are r0, r1"),
        (lambda s: s.jacobian("r1", s.kernels.q0, body="link7"), "point r1: body link7 does not have it"),
        (lambda s: s.jacobian("r1", s.kernels.q0, frame="world"), "frame: 'world' is not one of global, local, spatial"),
        (lambda s: s.inverse_dynamics(s.kernels.q0, np.zeros(3)), "v: its shape is (3,), and arm has 7 rates; give (…, 7)"),
    ],
)
def test_what_is_refused(ask, said):
    space = ncgen.joint_space(ncgen.compile(ncgen.load("arm"), "numpy"))
    with pytest.raises(ModelError) as refused:
        ask(space)
    assert said in str(refused.value)


@pytest.mark.parametrize("floating", [False, True])
def test_many_positions_with_the_same_rates(cranes, floating):
    """Rates of all coordinates at each of them are those at it alone, and the rates at one position those of each set of rates alone."""
    space = cranes[floating]
    records = [record for record in STATES if record["floating"] == floating]
    q = np.array([placed(space, record)[0] for record in records])
    v = np.array([np.array(record["v"])[placed(space, record)[1]] for record in records])
    close(space.velocities(q, v[0]), [space.velocities(each, v[0]) for each in q])
    close(space.velocities(q[0], v), [space.velocities(q[0], each) for each in v])
