"""Functions for CasADi: values beside ncgen's own, derivatives beside differences with 40 digits, and what an optimisation finds."""

from __future__ import annotations

import runpy
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sympy

import ncgen
from ncgen.exchange.export import export

casadi = pytest.importorskip("casadi")

pytestmark = [
    pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler"),
    pytest.mark.filterwarnings("ignore:.*singular"),
]

LARGE = ("arm", "robot")

STRICT = "CFLAGS=-O1 -ffp-contract=off -Wall -Wextra -Wpedantic -Werror"


def built(model: ncgen.Model, folder: Path) -> str:
    """The path of the library, compiled without a warning."""
    export(model, "casadi", folder)
    subprocess.run(["make", "-s", STRICT], cwd=folder, check=True, capture_output=True, text=True)
    return str(folder / f"{model.name}.so")


def rods() -> ncgen.Model:
    """Two rods on hinges one after the other, an open tree; with a spring of a parameter, and a force that depends on time."""
    m = ncgen.Model("rods")
    m.gravity((0, -9.81, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0.5, 0)), m.point("B", (0.9, 0))
    m.body("upper", [O, A], mass=1.2, inertia="point")
    m.body("lower", [A, B], mass=0.7, inertia="point")
    first, second = m.angle("first", x, A - O, z), m.angle("second", A - O, B - A, z)
    m.torque(second, -m.parameter("k", 3.0, "N m") * second)
    m.torque(first, m.input("push", "N m") + 0.3 * sympy.sin(5 * m.time))
    m.output("tip", B.y + 0.1 * B.y.acceleration * second.rate, "m")
    m.independent(first, second)
    return m


def pushed(name: str) -> ncgen.Model:
    """An example with an input along its first independent coordinate, and outputs of everything, of accelerations too."""
    model = rods() if name == "rods" else ncgen.load(name)
    if not model.inputs:
        coordinate = model.elements[model.chosen_independent[0]]
        model.torque(coordinate, model.input("push", "N m"))
        model.output("jerked", coordinate.acceleration + coordinate.rate**2 * model.inputs["push"].symbol)
    return model


def states(kernels, count: int, seed: int = 3):
    """Consistent positions and velocities with random inputs."""
    generator = np.random.default_rng(seed)
    names = kernels.model.chosen_independent
    for _ in range(count):
        step = 0.3 * generator.uniform(-1, 1, len(names))
        targets = {name: kernels.q0[kernels.index[name]] + float(x) for name, x in zip(names, step, strict=True)}
        q = ncgen.move(kernels, None, targets, steps=5).q
        rates = dict(zip(names, generator.uniform(-2, 2, len(names)).tolist(), strict=True))
        inputs = dict(zip(kernels.inputs, generator.uniform(-3, 3, len(kernels.inputs)).tolist(), strict=True))
        yield ncgen.start(kernels, q0=q, zd0=rates, inputs=inputs), inputs


def values(model: ncgen.Model, kernels, library: str, sim) -> tuple:
    """Arguments t, s, v, u, p of the functions at a state of ncgen's."""
    places = casadi.external(f"{model.name}_start", library)()["places"].full().ravel().astype(int)
    open_tree = casadi.external(f"{model.name}_dynamics", library).size1_in(1) < kernels.n
    count = len(kernels.parameters) - len(kernels.inputs)
    if open_tree:
        space = ncgen.joint_space(kernels)
        s, where = space.values(sim.q), [kernels.index[name] for name in space.rates]
        v = sim.qd[where]
    else:
        s, v = sim.q.copy(), sim.qd[places]
    return 0.0, s, v, sim.p[count:], sim.p[:count]


@pytest.mark.parametrize("name", ["rods", "cartpole", "fourbar", "cam", *(pytest.param(x, marks=pytest.mark.slow) for x in LARGE)])
def test_values_are_those_of_a_run(name, tmp_path):
    """Accelerations of the stepper, and its outputs; loops closed; velocities of all coordinates."""
    model = pushed(name)
    kernels, library = ncgen.compile(model), built(model, tmp_path)
    dynamics, outputs = (casadi.external(f"{name}_{what}", library) for what in ("dynamics", "outputs"))
    for sim, _ in states(kernels, 3):
        arguments = values(model, kernels, library, sim)
        sd, vd = (x.full().ravel() for x in dynamics(*arguments))
        if len(sd) == kernels.n:
            assert np.allclose(sd, sim.qd, rtol=0, atol=1e-10 * (1 + np.max(np.abs(sim.qd))))
            places = casadi.external(f"{name}_start", library)()["places"].full().ravel().astype(int)
            phi = casadi.external(f"{name}_constraints", library)(arguments[0], arguments[1], arguments[4]).full()
            assert np.max(np.abs(phi)) < 1e-9 * np.max(kernels.row_sizes)
            expected = sim.qdd[places]
        else:
            q = casadi.external(f"{name}_position", library)(arguments[0], arguments[1], arguments[4]).full().ravel()
            assert np.allclose(q, sim.q, rtol=0, atol=1e-12 * np.max(kernels.column_sizes))
            expected = sim.qdd[[kernels.index[c] for c in ncgen.joint_space(kernels).rates]]
        assert np.allclose(vd, expected, rtol=0, atol=1e-8 * (1 + np.max(np.abs(expected))))
        y = outputs(*arguments).full().ravel()
        assert np.allclose(y, list(sim.outputs.values()), rtol=1e-8, atol=1e-8 * (1 + np.max(np.abs(y))))


def differences(function, arguments: list, by: int, h: float) -> list:
    """∂out/∂arguments[by] of every output by central differences of order 8."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    found = []
    for k in range(len(arguments[by])):
        sums = 0.0
        for steps, weight in weights.items():
            for sign in (1, -1):
                moved = [np.array(a, dtype=float) for a in arguments]
                moved[by][k] += sign * steps * h
                out = function(*moved)
                out = out if isinstance(out, (tuple, list)) else (out,)
                sums = sums + sign * weight / h * np.concatenate([x.full().ravel(order="F") for x in out])
        found.append(sums)
    return found


@pytest.mark.parametrize("name", ["rods", "cartpole", "fourbar"])
@pytest.mark.parametrize("what", ["dynamics", "outputs"])
def test_derivatives_are_those_of_the_functions(name, what, tmp_path):
    """Jacobian, gradient and second derivatives beside differences of order 8, which round to 1e-9."""
    model = pushed(name)
    kernels, library = ncgen.compile(model), built(model, tmp_path)
    function = casadi.external(f"{name}_{what}", library)
    ((sim, _),) = states(kernels, 1)
    arguments = [np.atleast_1d(np.asarray(a, dtype=float)) for a in values(model, kernels, library, sim)]
    arguments[0] = np.array([0.1])
    generator = np.random.default_rng(5)
    seeds = [generator.uniform(-1, 1, function.size1_out(k)) for k in range(function.n_out())]
    nothing = [casadi.DM(function.size1_out(k), 1) for k in range(function.n_out())]

    jacobian, adjoint = function.jacobian(), function.reverse(1)
    blocks = jacobian(*arguments, *nothing)
    blocks = blocks if isinstance(blocks, (tuple, list)) else (blocks,)
    n_in, rows = function.n_in(), []
    for by in range(n_in):
        if len(arguments[by]):
            exact = np.vstack([blocks[o * n_in + by].full() for o in range(function.n_out())])
            found = np.array(differences(function, arguments, by, 2e-3)).T
            assert np.allclose(exact, found, rtol=0, atol=1e-8 * (1 + np.max(np.abs(found)))), f"by argument {by}"
            rows.append(exact)
    gradient = np.concatenate([x.full().ravel() for x in adjoint(*arguments, *nothing, *seeds)])
    assert np.allclose(gradient, np.hstack(rows).T @ np.concatenate(seeds), rtol=0, atol=1e-9 * (1 + np.max(np.abs(gradient))))

    second = adjoint.jacobian()
    given = [*arguments, *nothing, *seeds]
    found = second(*given, *[casadi.DM(adjoint.size1_out(k), 1) for k in range(n_in)])
    for by in (*range(n_in), *range(n_in + len(nothing), len(given))):
        if len(np.atleast_1d(given[by])) and adjoint.numel_in(by):
            exact = np.vstack([found[o * adjoint.n_in() + by].full() for o in range(n_in)])

            def asked(*numbers):
                middle = len(arguments)
                return adjoint(*numbers[:middle], *nothing, *numbers[middle:])

            moved = [*arguments, *seeds]
            place = by if by < n_in else by - len(nothing)
            numbers = np.array(differences(asked, moved, place, 2e-3)).T
            assert np.allclose(exact, numbers, rtol=0, atol=1e-7 * (1 + np.max(np.abs(numbers)))), f"second, by argument {by}"


def test_directions_are_the_same_derivatives(tmp_path, monkeypatch):
    """What is written out and what is found direction by direction."""
    from ncgen.exchange.export import casadi_target

    model = pushed("fourbar")
    written = built(model, tmp_path / "written")
    monkeypatch.setattr(casadi_target, "MAX_OPERATIONS", 0)
    directed = built(model, tmp_path / "directed")
    assert "the operations are those of one direction" in (tmp_path / "directed/README.md").read_text()
    one, other = (casadi.external("fourbar_dynamics", path) for path in (written, directed))
    sizes = [one.size1_in(k) for k in range(one.n_in())]
    generator = np.random.default_rng(2)
    given = [generator.uniform(-1, 1, size) for size in sizes]
    seeds = [generator.uniform(-1, 1, one.size1_out(k)) for k in range(2)]
    empty = [casadi.DM(one.size1_out(k), 1) for k in range(2)]
    for first, second, arguments in (
        (one.jacobian(), other.jacobian(), [*given, *empty]),
        (one.reverse(1).jacobian(), other.reverse(1).jacobian(), [*given, *empty, *seeds, *[casadi.DM(size, 1) for size in sizes]]),
    ):
        for a, b in zip(first(*arguments), second(*arguments), strict=True):
            assert np.allclose(a.full(), b.full(), rtol=1e-12, atol=1e-12)


def test_start_is_where_the_model_begins(tmp_path):
    """Joints of an open tree, all coordinates where loops are closed."""
    model = ncgen.load("cartpole")
    space, library = ncgen.joint_space(ncgen.compile(model)), built(model, tmp_path / "open")
    begin = casadi.external("cartpole_start", library)()
    assert np.allclose(begin["s"].full().ravel(), space.values(space.kernels.q0), atol=1e-14)
    assert begin["v"].full().ravel() == pytest.approx([0.0, 0.1], abs=1e-15)  # zd0 of the example
    assert [space.rates[int(k)] for k in begin["places"].full().ravel()] == ["s", "phi"]
    model = ncgen.load("fourbar")
    kernels, library = ncgen.compile(model), built(model, tmp_path / "closed")
    begin = casadi.external("fourbar_start", library)()
    assert np.allclose(begin["s"].full().ravel(), kernels.q0, atol=1e-14)
    assert [kernels.coordinates[int(k)] for k in begin["places"].full().ravel()] == ["psi"]


def test_a_swing_up_is_that_of_equations_by_hand():
    """100 intervals with a bound on the force: the same effort, and the same force up to what IPOPT leaves."""
    found = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "optimal_control.py"), run_name="optimal_control")
    problem = found["cartpole"]()
    ours, theirs = found["by_ncgen"](problem), found["cartpole_by_hand"](problem)
    assert "Solve_Succeeded" in ours.text and "Solve_Succeeded" in theirs.text
    assert ours.effort == pytest.approx(theirs.effort, rel=1e-7)
    assert np.max(np.abs(ours.inputs)) <= 12.0 * (1 + 1e-6)
    assert np.allclose(ours.inputs, theirs.inputs, rtol=0, atol=1e-4)
