"""Doors of the solver with arguments that do not fit, and mechanisms in which nothing moves."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import ModelError

NO_NUMBER = np.full(5, np.nan)
OF_Q = "5 needed: B.x, B.y, C.x, C.y, psi"
DOORS = {
    "freedom": lambda k, q=None, **more: ncgen.freedom(k, q, **more),
    "equilibrium": lambda k, q=None, **more: ncgen.equilibrium(k, q, **more),
    "assemble": lambda k, q=None, **more: ncgen.assemble(k, q, **more),
    "solve_position": lambda k, q=None, **more: ncgen.solve_position(k, q, **more),
    "move": lambda k, q=None, **more: ncgen.move(k, q, {"psi": 0.1}, **more),
    "sweep": lambda k, q=None, **more: ncgen.sweep(k, "psi", [0.1], q, **more),
}


def refused(call, *arguments, **named):
    with pytest.raises(ModelError) as caught:
        call(*arguments, **named)
    assert len(str(caught.value)) <= 300 and "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("door", DOORS.values(), ids=DOORS)
def test_every_door_refuses_the_same_in_the_same_words(fourbar, door):
    assert refused(door, fourbar, [1, 2]) == f"q: 2 numbers given, {OF_Q}"
    assert refused(door, fourbar, NO_NUMBER) == "q: B.x is nan; it must be a finite number"
    assert refused(door, fourbar, "B.x") == f"q: B.x given, {OF_Q}"
    assert refused(door, fourbar, {"psy": 1}) == "q: the mechanism has no free coordinate psy; it has B.x, B.y, C.x, C.y, psi"
    assert refused(door, fourbar, p=[1]) == "p: 1 number given, the mechanism has no parameter"
    assert refused(door, fourbar, p={"k": 1}) == "p: the mechanism has no parameter k; it has none"
    assert refused(door, fourbar, t="now") == "t is 'now'; it must be a finite number"
    assert refused(door, fourbar.model).endswith("given; ncgen.compile(model) makes them")
    assert refused(door, "fourbar") == "kernels needed, fourbar given; ncgen.compile(model) makes them"


@pytest.mark.parametrize("door", DOORS.values(), ids=DOORS)
def test_every_door_takes_names_and_numbers(fourbar, door):
    by_name = door(fourbar, dict(zip(fourbar.coordinates, fourbar.q0, strict=True)), p={})
    assert repr(by_name) == repr(door(fourbar)) == repr(door(fourbar, list(fourbar.q0), p=[]))


@pytest.mark.parametrize(
    "call, sentence",
    [
        (lambda k: ncgen.solve_position(k, held="psy"), "held: the mechanism has no free coordinate psy; it has B.x, B.y, C.x, C.y, psi"),
        (lambda k: ncgen.solve_position(k, tolerance=-1), "tolerance is -1; it must be positive"),
        (lambda k: ncgen.solve_position(k, limit=1.5), "limit is 1.5; it must be a positive whole number"),
        (lambda k: ncgen.move(k, None, "psi"), "targets: psi given; give {name: number}"),
        (lambda k: ncgen.move(k, None, {"psi": "a"}), "targets: psi is 'a'; it must be a finite number"),
        (lambda k: ncgen.move(k, None, {"psi": 1}, steps=0), "steps is 0; it must be a positive whole number"),
        (lambda k: ncgen.sweep(k, "psy", [1]), "name: the mechanism has no free coordinate psy; it has B.x, B.y, C.x, C.y, psi"),
        (lambda k: ncgen.sweep(k, "psi", 1.0), "values: 1.0 given; a list of numbers is needed"),
        (lambda k: ncgen.sweep(k, "psi", [0.0, np.nan]), "values[1] is nan; it must be a finite number"),
        (lambda k: ncgen.assemble(k, weights={"B.x": 0}), "weights: B.x is 0.0; it must be positive"),
        (lambda k: ncgen.assemble(k, weights={"B": 2}), "weights: the mechanism has no free coordinate B; it has B.x, B.y, C.x, C.y, psi"),
        (lambda k: ncgen.inspect(k.model), "given; ncgen.compile(model) makes them"),
        (lambda k: ncgen.inverse_dynamics(None), "a trajectory is needed, None given; ncgen.simulate makes one"),
    ],
)
def test_what_one_door_alone_asks_for(fourbar, call, sentence):
    assert refused(call, fourbar).endswith(sentence)


def test_one_name_holds_one_coordinate(fourbar):
    q = ncgen.solve_position(fourbar, {"psi": 0.2}, held="psi").q
    assert q[fourbar.index["psi"]] == 0.2 and np.max(np.abs(fourbar.phi(q))) < 1e-12


def test_parameters_by_name_are_used():
    """A mass on a spring sinks by m g/k."""
    m = Model("scale")
    k = m.parameter("k", 100.0)
    top, pan = m.point("top", (0, 0, 1), fixed=True), m.point("pan", (0, 0, 0), fixed="xy")
    m.body("load", [pan], mass=2.0)
    m.spring(top, pan, stiffness=k, free_length=1.0)
    m.gravity((0, 0, -9.81))
    kernels = ncgen.compile(m, backend="numpy")
    for given, stiffness in ((None, 100.0), ({"k": 400.0}, 400.0), ([50.0], 50.0)):
        assert ncgen.equilibrium(kernels, p=given).q == pytest.approx([-2 * 9.81 / stiffness], rel=1e-9)


def still():
    """Nothing at all; a point and a beam that are fixed; a row between fixed points; a truss."""
    yield Model("nothing")
    beam = Model("beam")
    beam.body("beam", [beam.point("A", (0, 0), fixed=True), beam.point("B", (1, 0), fixed=True)], mass=1.0, inertia="point")
    yield beam
    row = Model("row")
    row.distance(row.point("A", (0, 0), fixed=True), row.point("B", (1, 0), fixed=True))
    yield row
    truss = Model("truss")
    A, B, C = truss.point("A", (0, 0), fixed=True), truss.point("B", (1, 0), fixed=True), truss.point("C", (0.5, 1))
    truss.body("load", [C], mass=1.0)
    truss.distance(A, C)
    truss.distance(B, C)
    truss.gravity((0, -9.81, 0))
    yield truss


@pytest.mark.parametrize("model", list(still()), ids=lambda model: model.name)
def test_where_nothing_moves(model, capfd):
    """No freedom, in balance, nothing to swing; and not a word of LAPACK's."""
    kernels = ncgen.compile(model, backend="numpy")
    assert ncgen.freedom(kernels).dof == ncgen.inspect(kernels)["dof"] == 0
    balance = ncgen.equilibrium(kernels)
    assert np.array_equal(balance.q, kernels.q0) and balance.stable and balance.stiffnesses.size == 0
    assert ncgen.linearise(kernels).eigenvalues.size == 0
    assert np.array_equal(ncgen.assemble(kernels), kernels.q0)
    assert refused(ncgen.inverse_dynamics, ncgen.simulate(kernels, 0.1, points=3)).endswith("no degree of freedom is left for a motor")
    assert capfd.readouterr() == ("", "")


def test_a_truss_carries_its_load():
    """Each rod of √1.25 m takes half of m g on its slope, −λ/L along it: both multipliers are equal."""
    *_, truss = still()
    balance = ncgen.equilibrium(ncgen.compile(truss, backend="numpy"))
    assert balance.lam[0] == pytest.approx(balance.lam[1], rel=1e-12) and balance.lam[0] != 0


def test_a_free_mass_floats_where_it_is():
    """Three freedoms without a row or a force: every position is a balance, none is stable."""
    m = Model("mass")
    m.body("mass", [m.point("A", (1, 2, 3))], mass=1.0)
    kernels = ncgen.compile(m, backend="numpy")
    assert ncgen.freedom(kernels).dof == 3
    assert ncgen.equilibrium(kernels).q.tolist() == [1, 2, 3] and not ncgen.equilibrium(kernels).stable
