"""Springs and dampers with polynomial laws, and constant forces: their power in closed form, in positions that are turned and moved."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ncgen
from ncgen.exchange.toml_writer import to_toml
from ncgen.model.digest import digest

STIFFNESS, DAMPING = (3.0, -0.7, 1.3), (0.4, 0.25, 0.15)
AXES = Rotation.from_rotvec((0.3, -0.8, 0.4)).as_matrix().T.tolist()
CENTRE = np.array([0.3, 0.2, -0.1])


def body(model, name, origin=(0.0, 0.0, 0.0)):
    """A body with a point and two or three vectors."""
    point = model.point(f"{name}0", origin)
    vectors = [model.vector(f"{name}{k}", axis) for k, axis in enumerate(np.eye(3)[: 2 if name == "two" else 3].tolist(), 1)]
    return model.body(name, [point], vectors, mass=1.0, com=origin, inertia=(0.1, 0.2, 0.3))


def state(model, motions):
    """q and q̇ of bodies that are turned, moved, turning and moving: {body: (turned, moved, turning, moving)}, about the origin."""
    q, qd = {}, {}
    for name, (turned, moved, turning, moving) in motions.items():
        for element in model.bodies[name].elements:
            is_point = element in model.bodies[name].points
            value = turned.apply(element.initial) + (moved if is_point else 0.0)
            rate = np.cross(turning, turned.apply(element.initial)) + (moving if is_point else 0.0)
            for component, x, v in zip(element.components, value, rate, strict=True):
                q[component.name], qd[component.name] = x, v
    return q, qd


def power(model, motions):
    """What forces do in that state, and the potential energy."""
    kernels = ncgen.compile(model, "numpy")
    q, qd = ([each[name] for name in kernels.coordinates] for each in state(model, motions))
    q, qd = np.array(q), np.array(qd)
    return kernels.force(q, qd) @ qd, kernels.energy(q, qd)[1]


def motion(seed):
    rng = np.random.default_rng(seed)
    return Rotation.from_rotvec(rng.uniform(-1, 1, 3)), *rng.uniform(-1, 1, (3, 3))


def series(coefficients, x):
    return sum(c * abs(x) ** k for k, c in enumerate(coefficients))


@pytest.mark.parametrize("parent", ["ground", "one"])
@pytest.mark.parametrize("name", ["two", "three"])
def test_the_power_of_a_ball_spring(name, parent):
    model = ncgen.Model("balls")
    child, other = body(model, name), body(model, "one")
    model.ball_spring(model.ground if parent == "ground" else other, child, STIFFNESS, DAMPING, AXES)
    motions = {name: motion(1), "one": motion(2)}
    (turned, _, turning, _), (before, _, before_turning, _) = motions[name], motions["one"]
    if parent == "ground":
        before, before_turning = Rotation.identity(), np.zeros(3)
    rotation, relative = (turned * before.inv()).as_rotvec(), turning - before_turning
    rates = turned.apply(AXES) @ relative
    expected = -series(STIFFNESS, np.linalg.norm(rotation)) * (rotation @ relative) - sum(series(DAMPING, w) * w * w for w in rates)
    assert power(model, motions)[0] == pytest.approx(expected, rel=1e-13)


def test_the_power_of_an_anchor_spring_and_of_a_constant_force():
    model, force = ncgen.Model("anchored"), np.array([2.0, -1.0, 0.5])
    one = body(model, "one")
    model.anchor_spring(one, CENTRE, STIFFNESS, DAMPING)
    model.constant_force(one, CENTRE, force)
    turned, moved, turning, moving = motion(3)
    far, velocity = turned.apply(CENTRE) + moved - CENTRE, np.cross(turning, turned.apply(CENTRE)) + moving
    expected = -series(STIFFNESS, np.linalg.norm(far)) * (far @ velocity) - sum(series(DAMPING, v) * v * v for v in velocity)
    done, potential = power(model, {"one": (turned, moved, turning, moving)})
    assert done == pytest.approx(expected + force @ velocity, rel=1e-13)
    assert potential == pytest.approx(-force @ (CENTRE + far), rel=1e-13)


def swing(stiffness):
    """A rod on a hinge that turns 0.2 rad from where it begins at 0.5, with a polynomial spring at rest at 0.1."""
    model = ncgen.Model("swing")
    O, x, z = model.point("O", (0, 0), fixed=True), model.vector("x", (1, 0, 0), fixed=True), model.vector("z", (0, 0, 1), fixed=True)
    end = model.point("P", (np.cos(0.5), np.sin(0.5)))
    model.body("rod", [O, end], mass=1.0, inertia="rod")
    psi = model.angle("psi", x, end - O, z)
    coefficients = [model.parameter("k", 3.0), *stiffness[1:]] if stiffness[0] is None else stiffness
    model.polynomial_spring(psi, coefficients, DAMPING, 0.1)
    return model


@pytest.mark.parametrize("first", [3.0, None])
def test_acceleration_and_energy_of_a_polynomial_spring(first):
    """With numbers, and with a parameter."""
    kernels = ncgen.compile(swing((first, *STIFFNESS[1:])), "c")
    run = ncgen.simulate(kernels, 0.1, zd0={"psi": -0.8}, rtol=1e-10)
    s, v = run["psi"] - 0.1, run["rate(psi)"]
    tension = sum(k * s**n for n, k in enumerate(STIFFNESS, 1)) + series(DAMPING, v) * v
    assert np.allclose(run["rate(rate(psi))"], -3.0 * tension, rtol=1e-9)
    energies = [kernels.energy(q, qd)[1] for q, qd in zip(run.q, run.qd, strict=True)]
    assert np.allclose(energies, sum(k * s ** (n + 1) / (n + 1) for n, k in enumerate(STIFFNESS, 1)), rtol=1e-9)


def test_a_file_says_them(tmp_path):
    model = ncgen.Model("all")
    one, two = body(model, "one"), body(model, "two")
    model.ball_spring(one, two, STIFFNESS, DAMPING, AXES, "ball")
    model.anchor_spring(one, CENTRE, STIFFNESS, (0.4,))
    model.constant_force(two, CENTRE, (0.0, 0.0, 9.81))
    path = tmp_path / "all.toml"
    path.write_text(to_toml(model))
    assert digest(ncgen.load(path)) == digest(model)


@pytest.mark.parametrize(
    "act, message",
    [
        (lambda m, one: m.ball_spring(one, one), "give another body as child than one"),
        (lambda m, one: m.ball_spring(one, m.ground), "give another body as child than ground"),
        (lambda m, one: m.ball_spring(m.ground, one, axes=[(1, 0, 0), (0, 1, 0), (0, 1, 1)]), "three perpendicular unit vectors"),
        (lambda m, one: m.ball_spring(m.ground, one, (1, 2, 3, 4)), "stiffness: 4 coefficients given"),
        (lambda m, one: m.anchor_spring(m.ground, (0, 0, 0), (1,)), "ground has no point that moves"),
        (lambda m, one: m.constant_force(one, (0, 0), (1, 0, 0)), "2 components given"),
    ],
)
def test_mistakes_are_refused(act, message):
    model = ncgen.Model("wrong")
    with pytest.raises(ncgen.ModelError, match=message):
        act(model, body(model, "one"))
