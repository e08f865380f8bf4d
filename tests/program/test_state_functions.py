"""The motion as functions of a state: values beside those of a run, derivatives beside central differences with 60 digits."""

from __future__ import annotations

from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy

import ncgen
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.program.motions.dynamics import accelerations, cheapest
from ncgen.program.motions.state_functions import StateFunction, closed_functions, open_functions, operations, with_derivatives
from ncgen.solver.engines.partition_dynamics import samples, split_of
from ncgen.solver.joints.joint_space import joint_space
from ncgen.solver.positions.partition import choose_partitions

MP = {name: getattr(mpmath, name, None) for name in FUNCTIONS} | {"abs": abs, "pow": mpmath.power}
STEP = mpmath.mpf(10) ** -20
MANY = 60_000


def rods() -> ncgen.Model:
    """Two rods on hinges, one after the other, with an input, two parameters, time and an output of accelerations: an open tree."""
    m = ncgen.Model("rods")
    m.gravity((0, -9.81, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0.5, 0)), m.point("B", (0.9, 0))
    m.body("upper", [O, A], mass=m.parameter("m", 1.2, "kg"), inertia="point")
    m.body("lower", [A, B], mass=0.7, inertia="point")
    first, second = m.angle("first", x, A - O, z), m.angle("second", A - O, B - A, z)
    m.torque(second, -m.parameter("k", 3.0, "N m") * second)
    m.torque(first, m.input("push", "N m") + 0.3 * sympy.sin(5 * m.time))
    m.output("tip", B.y + 0.1 * B.y.acceleration * second.rate + m.inputs["push"].symbol, "m")
    m.independent(first, second)
    return m


def loop() -> ncgen.Model:
    """A four-bar with an input on its crank, and an output of accelerations."""
    m = ncgen.load("fourbar")
    crank = m.elements[m.chosen_independent[0]]
    m.torque(crank, m.input("push", "N m") + 0.3 * sympy.sin(5 * m.time))
    m.output("jerked", crank.acceleration + crank.rate**2 * m.inputs["push"].symbol)
    return m


@cache
def functions_of(name: str) -> tuple[ncgen.Kernels, list[StateFunction]]:
    """The kernels of a model, and its functions."""
    kernels = ncgen.compile(rods() if name == "rods" else loop())
    equations = kernels.programs.equations
    if name == "rods":
        space = joint_space(kernels)
        return kernels, open_functions(equations, space.followed, space.n)
    found = choose_partitions(kernels, kernels.q0, independent=kernels.model.chosen_independent)
    split = split_of(found.velocity)
    ways = accelerations(equations, split, samples(kernels, kernels.q0, kernels.p0), kernels.column_sizes)
    return kernels, closed_functions(equations, ways[cheapest(ways)], found.position.rows.tolist(), len(split.independent))


def state(kernels: ncgen.Kernels, name: str) -> tuple[ncgen.Simulation, dict[str, list[float]]]:
    """A state of a run, and the functions' arguments there."""
    independent = kernels.model.chosen_independent
    rates = dict(zip(independent, (0.7, -1.3), strict=False))
    sim = ncgen.start(kernels, zd0=rates, inputs={"push": 0.45})
    where = [kernels.index[name] for name in independent]
    s, count = (sim.q[where] if name == "rods" else sim.q), len(kernels.parameters) - 1
    given = {"t": [0.0], "s": s, "v": sim.qd[where], "u": sim.p[count:], "p": sim.p[:count]}
    return sim, {name: [float(x) for x in numbers] for name, numbers in given.items()}


def numbers(function: StateFunction, given: dict) -> list[list]:
    """What each result of a function has in its places, in 60 digits; of derivatives by directions, from a run for each of them."""
    arrays: dict[str, Any] = {name: [mpmath.mpf(x) for x in values] for name, values in given.items()}
    arrays["t"] = arrays["t"][0]
    if function.along:
        variables = list(function.along.variables.values())
        seeds = [[mpmath.mpf(k == j) for k in range(len(variables))] for j in range(len(variables))]
        columns = [evaluate(function.program, arrays | {"seed": seed}, MP, mpmath.mpf) for seed in seeds]
        row = {node: k for k, node in enumerate(function.along.nodes)}
        column = {leaf: j for j, leaf in enumerate(variables)}
        by = {f"jac_{result.name}_{a.name}": a.name for result in function.along.results for a in function.along.inputs}
        return [
            [columns[column[by[result.name], place[1]]][row[result.entries[place]]] for place in result.places]
            for result in function.results
        ]
    flat = iter(evaluate(function.program, arrays, MP, mpmath.mpf))
    return [[next(flat) for _ in result.places] for result in function.results]


def slopes(function: StateFunction, given: dict, by: str, k: int) -> list[list]:
    """How all entries of a function change with one number, by a central difference."""
    ends = [{**given, by: [x + sign * STEP * (j == k) for j, x in enumerate(given[by])]} for sign in (1, -1)]
    ahead, behind = (numbers(function, end) for end in ends)
    return [[(a - b) / (2 * STEP) for a, b in zip(one, other, strict=True)] for one, other in zip(ahead, behind, strict=True)]


@pytest.mark.parametrize("name", ["rods", "loop"])
def test_values_are_those_of_a_run(name):
    kernels, functions = functions_of(name)
    sim, given = state(kernels, name)
    found = {function.name: [np.array(x, dtype=float) for x in numbers(function, given)] for function in functions}
    where = [kernels.index[c] for c in kernels.model.chosen_independent]
    sd, vd = found["dynamics"]
    assert np.allclose(sd, sim.qd[where] if name == "rods" else sim.qd, rtol=0, atol=1e-12)
    assert np.allclose(vd, sim.qdd[where], rtol=1e-9)
    assert np.allclose(found["outputs"][0], list(sim.outputs.values()), rtol=1e-9)
    if name == "rods":
        assert np.allclose(found["position"][0], sim.q, rtol=0, atol=1e-12)
    else:
        assert len(found["constraints"][0]) == kernels.n - 1 and np.max(np.abs(found["constraints"][0])) < 1e-12
    taken = {f.name: [(a.name, a.size, a.is_read) for a in f.inputs] for f in functions}
    states, velocities = (2, 2) if name == "rods" else (kernels.n, 1)
    everything = [("t", 1, True), ("s", states, True), ("v", velocities, True), ("u", 1, True), ("p", len(kernels.parameters) - 1, True)]
    last = "position" if name == "rods" else "constraints"
    assert taken == {"dynamics": everything, "outputs": everything, last: [everything[0], everything[1], everything[4]]}


@pytest.mark.parametrize("most", [MANY, 0])
@pytest.mark.parametrize("name", ["rods", "loop"])
def test_derivatives_are_slopes(name, most):
    """Of every entry by every number, those left out being zero; written out, and by directions."""
    kernels, functions = functions_of(name)
    _, given = state(kernels, name)
    given["t"] = [0.1]
    with mpmath.workdps(60):
        for function in functions:
            seeds = {f"adj_{r.name}": [0.3 + 0.4 * k for k in range(r.shape[0])] for r in function.results}
            _, jacobian, adjoint, second = with_derivatives(function, most)
            assert (jacobian.along is function, second.along is adjoint) == (most == 0, most == 0)
            _hold(function, jacobian, given)
            _hold(adjoint, second, given | seeds)
            for argument, found in zip(function.inputs, numbers(adjoint, given | seeds), strict=True):
                for k in range(argument.size):
                    wanted = weighted(seeds, slopes(function, given, argument.name, k))
                    assert abs(found[k] - wanted) <= 1e-15 * (1 + abs(wanted))


def weighted(seeds: dict, results: list[list]) -> Any:
    """The sum of all entries of results, each times its seed."""
    return sum(x * y for seed, numbers in zip(seeds.values(), results, strict=True) for x, y in zip(seed, numbers, strict=True))


def test_arguments_are_those_of_casadi():
    """Values of outputs stand behind the inputs, and are not read; seeds behind them; a Jacobian has a block for each pair."""
    _, functions = functions_of("rods")
    inputs = [("t", 1, True), ("s", 2, True), ("v", 2, True), ("u", 1, True), ("p", 2, True)]
    values, seeds = [("out_sd", 2, False), ("out_vd", 2, False)], [("adj_sd", 2, True), ("adj_vd", 2, True)]
    taken = {f.name: [(a.name, a.size, a.is_read) for a in f.inputs] for f in with_derivatives(functions[0], MANY)}
    assert taken == {
        "dynamics": inputs,
        "jac_dynamics": inputs + values,
        "adj1_dynamics": inputs + values + seeds,
        "jac_adj1_dynamics": inputs + values + seeds + [(f"out_adj_{name}", size, False) for name, size, _ in inputs],
    }
    for argument, result in zip(functions[0].inputs, functions[0].adjoint().results, strict=True):
        assert result.shape == (argument.size, 1) and result.places == [(k, 0) for k in range(argument.size)]
    shapes = {result.name: result.shape for result in functions[0].jacobian(MANY).results}
    assert shapes == {f"jac_{of}_{name}": (2, size) for of in ("sd", "vd") for name, size, _ in inputs}


def _hold(function: StateFunction, jacobian: StateFunction, given: dict) -> None:
    """A Jacobian to the slopes of its function."""
    blocks = dict(zip([result.name for result in jacobian.results], numbers(jacobian, given), strict=True))
    for by in function.inputs:
        for k in range(by.size if by.is_read else 0):
            changes = slopes(function, given, by.name, k)
            for result, change in zip(function.results, changes, strict=True):
                block = next(r for r in jacobian.results if r.name == f"jac_{result.name}_{by.name}")
                assert block.shape == (result.shape[0], by.size)
                known = dict(zip(block.places, blocks[block.name], strict=True))
                for (row, _), wanted in zip(result.places, change, strict=True):
                    assert abs(known.get((row, k), 0) - wanted) <= 1e-15 * (1 + abs(wanted)), (block.name, row, k)


def test_derivatives_are_written_out_up_to_a_number_of_operations():
    """That many are not too many; one more is."""
    _, functions = functions_of("rods")
    function = functions[0]
    written = function.jacobian(MANY)
    needed = operations(function.graph, written.nodes)
    assert needed > 50
    assert function.jacobian(needed).along is None and function.jacobian(needed - 1).along is function
