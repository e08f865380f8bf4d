"""What joint space refuses before a compiled function could read beyond an array, and what it takes for a rotation."""

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import NcgenError
from ncgen.solver.joints.joint_space import JointSpace


def flying(backend: str) -> JointSpace:
    """A body that moves freely, with an arm on a hinge."""
    m = Model("flying")
    A, B, C, D = m.point("A", (0, 0, 0)), m.point("B", (1, 0, 0)), m.point("C", (0, 1, 0)), m.point("D", (1, 1, 0))
    z = m.vector("z", (0, 0, 1))
    m.body("base", points=[A, B, C], vectors=[z], mass=1.0, com=(0.3, 0.3, 0), inertia=[0.2, 0.2, 0.2])
    m.body("arm", points=[B, D], vectors=[z], mass=1.0, com=(1, 0.5, 0), inertia=[0.1, 0.1, 0.1])
    return ncgen.joint_space(ncgen.compile(m, backend))


@pytest.fixture(params=["numpy", "c"], scope="module")
def space(request):
    return flying(request.param)


TWO = {
    "short": lambda x: x[:-1],
    "long": lambda x: np.append(x, 0.0),
    "empty": lambda x: x[:0],
    "scalar": lambda x: 1.0,
    "NaN": lambda x: np.where(np.arange(len(x)) == len(x) - 1, np.nan, x),
    "infinite": lambda x: x + np.inf,
    "complex": lambda x: x + 1e-20j,
    "masked": lambda x: np.ma.masked_array(x, np.arange(len(x)) == 0),
    "texts": lambda x: x.astype(str),
    "objects": lambda x: np.array([None] * len(x)),
    "beyond doubles": lambda x: [10**400] * len(x),
    "uneven": lambda x: [[1.0], [1.0, 2.0]],
    "a mapping": lambda x: {"a": 1.0},
}


@pytest.mark.parametrize("kind", TWO)
def test_wrong_arrays_are_refused(space, kind):
    """One line from every function that takes a position or joint velocities; nothing is read beyond an array."""
    wrong, q, v = TWO[kind], np.array(space.kernels.q0), np.zeros(space.n)
    calls = [
        lambda: space.placed(wrong(v)),
        *(lambda f=f: f(wrong(q)) for f in (space.values, space.screws, space.mass_matrix, space.gravity, space.centre_of_mass)),
        *(lambda f=f: f(wrong(q), v) for f in (space.velocities, space.coriolis, space.inverse_dynamics, space.loads)),
        *(lambda f=f: f(q, wrong(v)) for f in (space.velocities, space.coriolis, space.inverse_dynamics, space.loads)),
        lambda: space.inverse_dynamics(q, v, wrong(v)),
        lambda: space.forward_dynamics(q, v, wrong(v)),
        lambda: space.inverse_dynamics_derivatives(q, wrong(v)),
        lambda: space.forward_dynamics_derivatives(wrong(q)),
        lambda: space.momentum_matrix(q, wrong(np.zeros(3))),
        lambda: space.jacobian("D", wrong(q)),
        lambda: space.position(base=(np.eye(3), wrong(np.zeros(3)))),
        lambda: space.inverse_kinematics("D", wrong(np.zeros(3))),
    ]
    for call in calls:
        with pytest.raises(NcgenError) as error:
            call()
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "rotation",
    [2 * np.eye(3), np.eye(3) + 0.1 * np.eye(3, k=1), np.full((3, 3), np.nan), np.diag([1.0, 1, -1]), np.eye(2), 1j * np.eye(3),
     np.full((3, 3), 1e300), "R", None],
)  # fmt: skip
def test_only_rotations_turn_a_base(space, rotation):
    with pytest.raises(NcgenError, match="base: rotation"):
        space.position(base=(rotation, np.zeros(3)))
    if rotation is not None:
        with pytest.raises(NcgenError, match="rotation"):
            space.inverse_kinematics("D", np.zeros(3), rotation)


def test_a_rotation_of_seven_digits_passes(space):
    c, s = np.round(np.cos(0.3), 7), np.round(np.sin(0.3), 7)
    q = space.position(base=([[c, -s, 0], [s, c, 0], [0, 0, 1]], (0, 0, 2.0)))
    assert space.element(space.point("D"), q) == pytest.approx((np.cos(0.3) - np.sin(0.3), np.sin(0.3) + np.cos(0.3), 2.0), abs=1e-6)


@pytest.mark.parametrize("wrong", [{"base": None}, {"psi": 1.0}, "psi", [1.0], {"D": 10**400}, {1: 1.0}])
def test_joint_values(space, wrong):
    with pytest.raises(NcgenError):
        space.position(wrong)


def test_functions_check_their_sizes_themselves():
    """Whoever calls them: a function of C never gets an array of another size."""
    space = flying("c")
    for count in range(space.n):
        with pytest.raises(NcgenError, match="x has the shape"):
            space._functions("joint_position", 0.0, np.zeros(count), space.kernels.p0)
    with pytest.raises(NcgenError, match="1 arrays given, 2 needed"):
        space._functions("joint_position", 0.0, np.zeros(space.n))
