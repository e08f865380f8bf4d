"""What a model refuses as a number, such as a negative mass, every public function refuses as the value of a parameter."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError, NcgenError

GRAVITY = (0, -9.81, 0)


def pendulum(m, mass=2.0, length=1.0, moment=0.1):
    """A rod with another one's end hanging from it by a massless rod."""
    A, B, C = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0)), m.point("C", (1, -1))
    m.body("bob", points=[A, B], mass=mass, inertia=moment)
    m.body("end", points=[C], mass=1.0)
    m.distance(B, C, length)
    m.gravity(GRAVITY)


def tumbling(m, a=0.2):
    """A free body of principal moments a, 0.3 and 0.2 kg m²."""
    P = m.point("P", (0, 0, 0))
    axes = [m.vector(f"u{k}", tuple(float(k == i) for i in range(3))) for k in range(3)]
    m.body("brick", points=[P], vectors=axes, mass=1.0, com=(0, 0, 0), inertia=(a, 0.3, 0.2))


def geared(m, ratio=2.0, rotor=0.01):
    """Two flywheels joined by a gear, one with a motor's armature."""
    for name, x in (("a", 0.0), ("b", 3.0)):
        centre, rim = m.point(f"{name}0", (x, 0), fixed=True), m.point(f"{name}1", (x + 1, 0))
        m.body(name, points=[centre, rim], mass=1.0, com=(x, 0), inertia=0.5)
        ground = m.vector(f"{name}x", (1, 0), fixed=True)
        m.angle(f"psi_{name}", ground, rim - centre, m.vector(f"{name}z", (0, 0, 1), fixed=True))
    m.gear(m.elements["psi_a"], m.elements["psi_b"], ratio, 1.0)
    m.rotor(m.elements["psi_a"], rotor)


def rolling(m, radius=0.5):
    """A disc on a plane."""
    centre = m.point("C", (0, 0, 0.5))
    axle, across, third = m.vector("u", (0, 1, 0)), m.vector("v", (1, 0, 0)), m.vector("w", (0, 0, 1))
    disc = m.body("disc", points=[centre], vectors=[axle, across, third], mass=1.0, com=(0, 0, 0.5), inertia=(0.1, 0.2, 0.1))
    m.rolling(disc, centre, axle, across, radius)


def leaning(m, cosine=0.6):
    """A fixed vector and one that turns at a given angle to it."""
    P = m.point("P", (0, 0, 0), fixed=True)
    u, v, w = m.vector("u", (0.8, 0.0, 0.6)), m.vector("v", (0, 1, 0)), m.vector("w", (-0.6, 0.0, 0.8))
    m.body("top", points=[P], vectors=[u, v, w], mass=1.0, com=(0, 0, 0), inertia=(0.1, 0.1, 0.1))
    m.vector_vector(u, m.vector("z", (0, 0, 1), fixed=True), cosine)


CASES = [
    (pendulum, "mass", 2.0, (-1.0, -1e-12), (0.0, 3.0)),
    (pendulum, "length", 1.0, (-1.0, 0.0), (1.2,)),
    (pendulum, "moment", 0.1, (-0.1,), (0.0, 0.4)),
    (tumbling, "a", 0.2, (-0.1, 0.05, 0.6), (0.1, 0.5)),
    (geared, "ratio", 2.0, (0.0,), (-2.0,)),
    (geared, "rotor", 0.01, (-0.01,), (0.0, 0.02)),
    (rolling, "radius", 0.5, (-0.5, 0.0), (0.4,)),
    (leaning, "cosine", 0.6, (1.5, -1.5, 1.0), (0.5,)),
]
VALUES = [
    (build, name, usual, value, accepted)
    for build, name, usual, bad, good in CASES
    for accepted, values in ((False, bad), (True, good))
    for value in values
]
IDS = [f"{build.__name__}-{name}-{value}" for build, name, _, value, _ in VALUES]


def model_of(build, name, value, usual=None):
    """The model with a number in that place, or with a parameter called x_ whose default is the usual number."""
    m = ncgen.Model(build.__name__)
    build(m, **{name: value if usual is None else m.parameter("x_", usual)})
    return m


def refusal(call):
    """What a call says, None where it refuses nothing of the parameters."""
    try:
        call()
    except NcgenError as error:
        return str(error) if "p: with" in str(error) else None
    return None


@pytest.mark.parametrize("build, name, usual, value, accepted", VALUES, ids=IDS)
def test_p_is_refused_where_the_number_is(build, name, usual, value, accepted):
    """The model that is made with the number is the reference: both are refused for the same reason, or neither."""
    kernels = ncgen.compile(model_of(build, name, None, usual), backend="numpy")
    said = refusal(lambda: ncgen.freedom(kernels, p={"x_": value}))
    if accepted:
        model_of(build, name, value)
        assert said is None
        return
    with pytest.raises(ModelError) as refused:
        model_of(build, name, value)
    assert said is not None and said.startswith(f"p: with x_ = {value:g}, ")
    reason = str(refused.value).split("; ")[0]
    assert reason.removeprefix("user model, ").split(" m")[0] in said


@pytest.fixture(scope="module")
def kernels():
    """A pendulum whose masses are an expression of a parameter, and whose length is one."""
    m = ncgen.Model("expressions")
    M = m.parameter("M", 2.0)
    pendulum(m, mass=3 * M - 1, length=m.parameter("L", 1.0))
    return ncgen.compile(m)


def objective(q, qd):
    return float(q[-1, 0]), np.zeros_like(q), np.zeros_like(q)


SINGLE = {
    "simulate": lambda k, p: ncgen.simulate(k, 0.01, p=p),
    "start": lambda k, p: ncgen.start(k, p=p),
    "start of many": lambda k, p: ncgen.start(k, 2, p=p),
    "assemble": lambda k, p: ncgen.assemble(k, p=p),
    "freedom": lambda k, p: ncgen.freedom(k, p=p),
    "solve_position": lambda k, p: ncgen.solve_position(k, p=p),
    "move": lambda k, p: ncgen.move(k, None, {"B.x": 1.0}, p=p),
    "sweep": lambda k, p: ncgen.sweep(k, "B.y", [0.0], p=p),
    "equilibrium": lambda k, p: ncgen.equilibrium(k, p=p),
    "linearise": lambda k, p: ncgen.linearise(k, p=p),
    "sensitivities": lambda k, p: ncgen.sensitivities(k, 0.01, 2, p=p),
    "gradient": lambda k, p: ncgen.gradient(k, 0.01, 2, objective, p=p),
    "hessian": lambda k, p: ncgen.hessian(k, 0.01, 2, objective, p=p),
    "driven_positions": lambda k, p: ncgen.driven_positions(k, [0.0], p=p),
    "check": lambda k, p: ncgen.solver.runs.run.Run.from_arguments(k.model, 1.0, p=p),
}


@pytest.mark.parametrize("name", SINGLE)
def test_every_public_function_names_the_parameter(kernels, name):
    """Expressions of parameters are judged by their value: 3 M − 1 kg is −0.7 kg at M = 0.1."""
    for p in ({"M": 0.1}, [0.1, 1.0]):
        with pytest.raises(ModelError) as refused:
            SINGLE[name](kernels, p)
        assert str(refused.value) == "p: with M = 0.1, body bob: the mass is -0.7 kg; give a positive number"
    with pytest.raises(ModelError, match="^p: with L = -1, .*distance B-C: the length is -1 m; "):
        SINGLE[name](kernels, {"L": -1.0})


def test_in_a_batch_one_state_is_refused(kernels):
    """The others move; where all are refused, the call is."""
    run = ncgen.simulate(kernels, 0.01, p={"M": [2.0, 0.1, 3.0, np.nan]})
    assert run.status[1] == "with M = 0.1, body bob: the mass is -0.7 kg; give a positive number"
    assert [run.status[0], run.status[2]] == ["ok", "ok"] and np.isnan(run.q[1]).all()
    assert run.status[3] != "ok" and "mass" not in run.status[3]
    with pytest.raises(ModelError, match="no state of the batch has a start; the first: with M = 0.1, body bob: the mass is -0.7 kg"):
        ncgen.simulate(kernels, 0.01, p={"M": [0.1, 0.2]})
    gradients = ncgen.gradient(kernels, 0.01, 2, objective, p={"M": [2.0, 0.1]})
    assert gradients.status == ("ok", "with M = 0.1, body bob: the mass is -0.7 kg; give a positive number")
    with pytest.raises(ModelError, match="^p of state 1: with M = 0.1, body bob: the mass is -0.7 kg"):
        ncgen.accelerations(kernels, kernels.q0, {}, p={"M": [2.0, 0.1]})


@pytest.mark.parametrize("integrator", ["dopri5", "radau"])
def test_a_study_says_which_variants_are_none(kernels, integrator):
    """Side by side and one at a time."""
    found = ncgen.study(
        kernels.model, vary={"L": [1.0, -0.5]}, keep=["B.y"], duration=0.01, formalism="coordinate-partitioning", integrator=integrator
    )
    assert found["ok"].tolist() == [True, False]
    assert "with L = -0.5, user model, distance B-C: the length is -0.5 m" in found.messages[1]


def test_states_do_not_bring_them_in(kernels):
    """`reset` judges parameters that are others than before, and changes nothing where it refuses."""
    bad = kernels.p0.copy()
    bad[kernels.parameters.index("M")] = 0.1
    sim = ncgen.start(kernels)
    with pytest.raises(ModelError, match="^p: with M = 0.1, body bob: the mass is -0.7 kg"):
        sim.reset(replace(sim.state, p=bad, t=3.0))
    assert sim.t == 0.0 and np.array_equal(sim.p, kernels.p0)
    sims = ncgen.start(kernels, 2)
    with pytest.raises(ModelError, match="^reset: p of simulation 1: with M = 0.1"):
        sims.reset(states=replace(sims.states, p=np.array([kernels.p0, bad])))
    assert np.array_equal(sims.p, [kernels.p0, kernels.p0])


def test_conditions_travel_with_the_model(kernels):
    """Pickled kernels and copied models know them, and a refused fact leaves none behind."""
    import copy
    import pickle

    for other in (pickle.loads(pickle.dumps(kernels)), ncgen.compile(copy.deepcopy(kernels.model))):
        with pytest.raises(ModelError, match="the mass is -0.7 kg"):
            ncgen.freedom(other, p={"M": 0.1})
    m = model_of(geared, "ratio", None, 2.0)
    kept = len(m.conditions)
    with pytest.raises(ModelError):
        m.gear(m.elements["psi_a"], m.elements["psi_a"], m.parameters["x_"], 1.0)
    assert len(m.conditions) == kept == 1


def test_points_that_meet_at_a_parameter_are_refused():
    """A body's two points lie |x| apart; the cosine of what moves with them is measured, so that it has no say."""
    m = ncgen.Model("meeting")
    A = m.point("A", (0, 0), fixed=True)
    m.body("rod", points=[A, m.point("B", (m.parameter("x", 1.0), 0))], mass=1.0, inertia=0.1)
    kernels = ncgen.compile(m, backend="numpy")
    with pytest.raises(ModelError, match="^p: with x = 0, body rod, distance A-B: the length is 0 m; give points that are apart"):
        ncgen.freedom(kernels, p={"x": 0.0})
    assert math.isclose(ncgen.assemble(kernels, p={"x": -2.0})[0], -2.0)
