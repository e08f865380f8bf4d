"""Accelerations by recursion over the tree of bodies, judged by R of all coordinates, by 50 digits, and by closed forms."""

from __future__ import annotations

from functools import cache, cached_property

import mpmath
import numpy as np
import pytest
import sympy
from every_example import long_ones_slow

import ncgen
from ncgen import Model
from ncgen.errors import SingularError
from ncgen.exchange.examples import example_module, example_names, load
from ncgen.program.ir.cost import cost
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.motions import dynamics
from ncgen.program.programs import Split
from ncgen.program.tree.rates import NoRecursion
from ncgen.program.tree.recursion import Recursion, assemble_recursions
from ncgen.solver.engines.partition_dynamics import samples
from ncgen.solver.positions.partition import choose_partitions
from ncgen.symbolic.tree import spanning_tree

EXACT = {name: getattr(mpmath, name) for name in ("sin", "cos", "tan", "sqrt", "exp", "log", "asin", "acos", "atan")} | {"abs": abs}


class Case:
    """A mechanism with its choice of independent coordinates, samples and random speeds."""

    def __init__(self, model: Model) -> None:
        self.model, self.kernels = model, ncgen.compile(model, "numpy")
        k = self.kernels
        q = ncgen.assemble(k)
        part = choose_partitions(k, q, independent=model.chosen_independent).velocity
        self.split = Split(*(tuple(a.tolist()) for a in (part.rows, part.dependent, part.independent)))
        self.samples = samples(k, q, k.p0)
        self.given = k.programs.equations, self.split, self.samples, k.column_sizes
        self.speeds = np.random.default_rng(7).standard_normal(len(self.split.independent))

    @cached_property
    def ways(self):
        """The accelerations in every way."""
        return dynamics.accelerations(*self.given)

    @property
    def judge(self):
        """R of all coordinates."""
        return self.ways["all coordinates"]

    def values(self, program, sample, number=float):
        """q̇, z̈ and power at a sample."""
        inputs = {"t": number(sample.t)} | {
            n: [number(float(x)) for x in v] for n, v in (("q", sample.q), ("zd", self.speeds), ("p", sample.p))
        }
        found = evaluate(program, inputs, EXACT if number is mpmath.mpf else None, number)
        return np.array([float(x) for x in found[:-1]])

    def apart(self, program, other) -> float:
        """The largest difference of two programs in all samples, of the rates and of the rest relative to their largest."""
        worst = 0.0
        for sample in self.samples:
            a, b = self.values(program, sample), self.values(other, sample)
            for part in (slice(0, self.kernels.n), slice(self.kernels.n, None)):
                worst = max(worst, np.max(np.abs(a[part] - b[part])) / max(np.max(np.abs(b[part])), 1e-3))
        return worst


@cache
def case(name: str) -> Case:
    return Case(load(name))


@pytest.mark.parametrize("name", long_ones_slow(name for name in example_names() if name != "jansen"))
def test_accelerations_are_those_of_all_coordinates(name):
    assert case(name).apart(case(name).ways["composite"], case(name).judge) < 1e-11


@pytest.mark.parametrize("name, most", [("robot", 3100), ("arm", 2650), ("stewart", 1800), ("excavator", 620)])
def test_it_takes_fewer_operations_and_is_chosen(name, most):
    ways = {way: cost(program).total for way, program in case(name).ways.items()}
    chosen = dynamics.assemble_dynamics(*case(name).given).acceleration
    assert ways["composite"] <= most and cost(chosen).total == min(ways.values()) < 0.75 * ways["all coordinates"]


@pytest.mark.parametrize(("name", "less"), [("fourbar", 0), ("nfourbar", 150), ("andrews", 150)])
def test_small_plane_mechanisms_keep_what_is_cheaper(name, less):
    """The recursion takes as many operations for one four-bar, of which those that look at pivots decide, and far more for others."""
    ways = {way: cost(program).total for way, program in case(name).ways.items()}
    chosen = dynamics.assemble_dynamics(*case(name).given).acceleration
    assert cost(chosen).total == ways["all coordinates"] <= ways["composite"] - less


def test_articulated_and_composite_say_the_same():
    """Five joints are few for the articulated recursion, which must give the same; twenty are many, and it is cheaper."""
    short = Case(example_module("arm").build(5))
    assert short.apart(short.ways["articulated"], short.ways["composite"]) < 1e-12
    assert cost(short.ways["composite"]).total < cost(short.ways["articulated"]).total
    long = Case(example_module("arm").build(20)).ways
    assert cost(long["composite"]).total > 1.2 * cost(long["articulated"]).total and dynamics.cheapest(long) == "articulated"


@pytest.mark.parametrize("away", [0.0, 1e6])
def test_digits_far_from_the_origin(away):
    """An arm a thousand kilometres away loses what its positions have lost, 1e-10 m, and not that times its distance over its size."""
    model = Model("far")
    places = np.array([[0.0, 0, 0], [0.4, 0, 0.1], [0.7, 0.1, 0.3]]) + away
    points = [model.point(f"P{i}", place, fixed=i == 0) for i, place in enumerate(places)]
    axes = [model.vector(f"u{i}", u, fixed=i == 0) for i, u in enumerate([(0, 0, 1), (0, 1, 0), (1, 0, 0)])]
    for i in range(2):
        model.body(f"link{i}", points[i : i + 2], axes[i : i + 2], mass=1.0, inertia=[0.02, 0.03, 0.04])
    model.gravity((0, 0, -9.81))
    far = Case(model)
    program = far.ways["composite"]
    for sample in far.samples[1:]:
        exact = far.values(program, sample, mpmath.mpf)
        assert np.max(np.abs(far.values(program, sample) - exact)) < (1e-8 if away else 1e-13) * np.max(np.abs(exact))


def test_a_parameter_that_tilts_an_axis_is_seen():
    """Positions with other parameters are among the samples, and what is left out vanishes there, too."""
    model = Model("tilted")
    tilt = model.parameter("tilt", 0.3, "rad")
    A, B = model.point("A", (0, 0, 0), fixed=True), model.point("B", (1, 0, 0))
    y = model.vector("y", (0, 1, 0), fixed=True)
    u = model.vector("u", (0, sympy.cos(tilt.symbol), sympy.sin(tilt.symbol)))
    C = model.point("C", (2, 0, 0))
    model.body("first", [A, B], [y, u], mass=1.0, inertia=[0.1, 0.1, 0.1])
    model.body("second", [B, C], [u], mass=1.0, inertia=[0.1, 0.1, 0.1])
    model.gravity((0, 0, -9.81))
    tilted = Case(model)
    assert len({float(s.p[0]) for s in tilted.samples}) > 2
    assert tilted.apart(tilted.ways["composite"], tilted.judge) < 1e-11


def rolling_tip(parameter: bool) -> Model:
    """An arm of 0.4 m that turns about z, and a plate that turns about the arm's own line, by the angle roll."""
    m = Model("rolling_tip")
    size = m.parameter("size", 0.4) if parameter else 0.4
    O = m.point("O", (0, 0, 0), fixed=True)
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    A = m.point("A", (size, 0, 0), fixed="z")
    C = m.point("C", (size, 0, -0.3))
    m.body("arm", [O, A], [z], mass=2.0, inertia=0.05)
    m.body("plate", [O, A, C], mass=1.0, inertia=0.02)
    m.angle("turn", start=x, end=A - O, axis=z)
    m.angle("roll", start=-z, end=C - A, axis=A - O)
    m.gravity((0, 0, -9.81))
    return m


@pytest.mark.parametrize("parameter", [False, True])
def test_the_rate_of_an_angle_about_a_long_axis(parameter):
    """The screw is the arm's own vector, of 0.4 m, so the angle's rate is 0.4 times that of the screw, wherever the arm is."""
    case = Case(rolling_tip(parameter))
    work = Recursion(case.given[0], None, *case.given[2:])
    roll = work.rates.own[next(c for c, component in enumerate(case.given[0].free) if component.name == "roll")]
    (row,) = [row for row in work.rates.rows() if roll in row.entries]
    (screw,) = set(row.entries) - {roll}
    ratio = row.entries[screw]
    assert np.max(np.abs(np.abs(work.rates.sampling[ratio]) - [s.p[0] if parameter else 0.4 for s in case.samples])) < 1e-15
    loads = [work.graph.ops[k].leaf for k in work.graph.below([ratio]) if work.graph.ops[k].code == "load"]
    assert {load.array for load in loads} == ({"p"} if parameter else set())


def test_a_body_without_mass_is_refused_by_name():
    model = Model("light")
    A, B, C = (model.point(n, (x, 0.0), fixed=not x) for n, x in zip("ABC", (0.0, 1.0, 2.0), strict=True))
    model.body("heavy", [A, B], mass=1.0, inertia=0.1)
    model.body("nothing", [B, C])
    light = Case(model)
    with pytest.raises(SingularError, match="light: a motion of the mechanism has no inertia; give the bodies that move mass"):
        assemble_recursions(*light.given)


def test_too_few_positions_conclude_nothing():
    equations, split, found, sizes = case("robot").given
    with pytest.raises(NoRecursion, match="too few positions"):
        assemble_recursions(equations, split, found[:3], sizes)


def test_one_position_with_other_parameters_concludes_nothing():
    """Where no other position is found every ratio of entries seems constant, and an angle's acceleration was 24 % off."""
    equations, split, found, sizes = Case(rolling_tip(parameter=True)).given
    others = [sample._replace(q=found[0].q) for sample in found if not np.array_equal(sample.p, found[0].p)]
    with pytest.raises(NoRecursion, match="too few positions"):
        assemble_recursions(equations, split, [found[0], *others, *others], sizes)


@pytest.mark.parametrize(
    "name, links, freedoms",
    [("robot", 8, 8), ("arm", 7, 7), ("fourbar", 3, 3), ("delta", 10, 24), ("stewart", 1, 6), ("pendulum", 0, 0), ("suspension", 4, 5)],
)
def test_the_tree_and_its_freedoms(name, links, freedoms):
    """Seven hinges of an arm; a Stewart platform floats on legs that are lengths only; the robot's tree has two joints more than it has
    freedoms, which its loop takes."""
    tree = spanning_tree(load(name))
    assert (len(tree.links), tree.dof) == (links, freedoms)
    assert all(link.parent is None or link.parent < number for number, link in enumerate(tree.links))
