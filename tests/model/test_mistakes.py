"""Every mistake in a description is refused in one line that names the thing by the user's own name."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest
import sympy

import ncgen
from ncgen import Model, ModelError

NAN, INF = math.nan, math.inf


class Scene:
    """A model with a few things to make mistakes with."""

    def __init__(self):
        m = self.model = Model("scene")
        self.pivot, self.tip = m.point("pivot", (0, 0, 0), fixed=True), m.point("tip", (2, 0, 0))
        self.far, self.side = m.point("far", (4, 0, 0)), m.point("side", (0, 1, 0))
        self.twin = m.point("twin", (2, 0, 0))
        self.ex, self.ez = m.vector("ex", (1, 0, 0)), m.vector("ez", (0, 0, 1), fixed=True)
        self.length = m.parameter("length", 2.0)
        other = Model("other")
        self.namesake = other.point("tip", (2, 0, 0))
        self.stranger, self.wind = other.point("stranger", (1, 1, 1)), other.vector("wind", (0, 1, 0))

    def beam(self, **inertia):
        basis = [self.pivot, self.tip, self.ez]
        return self.model.body(
            "beam", points=[self.pivot, self.tip], vectors=[self.ez], basis=basis, **{"mass": 1.0, "inertia": "point", **inertia}
        )


# What is done wrong, and words that the message must contain.
MISTAKES = {
    "a point without a number": (lambda s: s.model.point("loose", (0, NAN, 0)), ["point loose, y", "nan"]),
    "a point at infinity": (lambda s: s.model.point("loose", (0, 0, INF)), ["point loose, z", "inf"]),
    "a point with a word": (lambda s: s.model.point("loose", (0, 0, "up")), ["point loose, z", "'up'"]),
    "a point of four numbers": (lambda s: s.model.point("loose", (0, 0, 0, 1)), ["point loose", "4 numbers"]),
    "a point of one number": (lambda s: s.model.point("loose", (0,)), ["point loose", "1 number given"]),
    "a name used twice": (lambda s: s.model.point("tip", (0, 0, 1)), ["point tip", "already used for point tip"]),
    "a vector named like a point": (lambda s: s.model.vector("tip", (0, 0, 1)), ["vector tip", "point tip"]),
    "a parameter named like a point": (lambda s: s.model.parameter("tip", 1.0), ["parameter tip", "point tip"]),
    "a point named like a parameter": (lambda s: s.model.point("length", (0, 0, 1)), ["point length", "already used"]),
    "an angle named like a vector": (lambda s: s.model.angle("ex", s.ex, s.ex, s.ez), ["angle ex", "vector ex"]),
    "a name with a blank": (lambda s: s.model.point("my point", (0, 0, 0)), ["'my point'", "letters"]),
    "a name that is none": (lambda s: s.model.point("", (0, 0, 0)), ["point name ''"]),
    "a name that begins with a digit": (lambda s: s.model.parameter("2nd", 1.0), ["parameter name '2nd'"]),
    "a model without a name": (lambda s: Model("no/slash"), ["model name 'no/slash'"]),
    "an unknown form": (lambda s: Model("m", form="tangent"), ["'tangent'", "smooth"]),
    "a vector that is too long": (lambda s: s.model.vector("axle", (1, 1, 0)), ["vector axle", "1.41421"]),
    "a vector of nothing": (lambda s: s.model.vector("axle", (0, 0, 0)), ["vector axle", "length is 0,"]),
    "a vector without a number": (lambda s: s.model.vector("axle", (NAN, 0, 1)), ["vector axle, x", "nan"]),
    "a parameter without a number": (lambda s: s.model.parameter("k", NAN), ["parameter k", "nan"]),
    "a missing point by name": (lambda s: s.model.distance("tip", "tipp"), ["distance", "no point tipp"]),
    "a vector for a point": (lambda s: s.model.distance(s.tip, s.ex), ["distance", "vector ex is not a point"]),
    "a point of another model": (lambda s: s.model.distance(s.tip, s.stranger), ["point stranger", "another model"]),
    "a namesake of another model": (lambda s: s.model.distance(s.pivot, s.namesake), ["point tip", "another model"]),
    "a vector of another model": (lambda s: s.model.unit(s.wind), ["vector wind", "another model"]),
    "a force on another model": (lambda s: s.model.force(s.stranger, (1, 0, 0)), ["point stranger", "another model"]),
    "an angle across models": (lambda s: s.model.angle("psi", s.ex, s.wind, s.ez), ["angle psi", "wind", "another model"]),
    "a segment of no length": (lambda s: s.model.distance(s.tip, s.twin), ["distance tip-twin", "0 m"]),
    "a negative length": (lambda s: s.model.distance(s.tip, s.far, -2.0), ["distance tip-far", "-2 m"]),
    "a length that is none": (lambda s: s.model.distance(s.tip, s.far, NAN), ["distance tip-far", "nan"]),
    "an angle to no segment": (lambda s: s.model.vector_segment(s.ez, s.tip - s.twin), ["angle ez", "tip-twin", "length 0"]),
    "a segment of length zero": (lambda s: s.model.vector_segment(s.ez, s.tip - s.far, 0.0), ["ez", "tip-far", "0 m"]),
    "a vector along its segment": (lambda s: s.model.vector_segment(s.ex, s.far - s.tip), ["ex", "far-tip", "cosine is 1", "of 0"]),
    "a vector against its segment": (lambda s: s.model.vector_segment(s.ex, s.tip - s.far), ["ex", "tip-far", "cosine is -1", "pi"]),
    "vectors along each other": (lambda s: s.model.vector_vector(s.ex, s.ez, 1.0), ["ex", "ez", "an angle of 0"]),
    "vectors against each other": (lambda s: s.model.vector_vector(s.ex, s.ez, math.cos(math.pi - 5e-7)), ["ex", "ez", "angle of pi"]),
    "an angle of no side": (lambda s: s.model.angle("psi", s.ex, s.twin - s.tip, s.ez), ["angle psi", "twin-tip", "length 0"]),
    "a side along its axis": (lambda s: s.model.angle("psi", s.ex, s.ez, s.ez), ["angle psi", "ez", "parallel to the axis"]),
    "a sloped side along its axis": (lambda s: s.model.angle("psi", s.ez, s.far - s.tip, s.ex), ["angle psi", "far-tip", "parallel"]),
    "a point for a direction": (lambda s: s.model.angle("psi", s.tip, s.ex, s.ez), ["angle psi", "tip", "not a direction"]),
    "an angle in no form": (lambda s: s.model.angle("psi", s.ex, s.ex, s.ez, form="round"), ["'round'", "smooth"]),
    "gravity of one number": (lambda s: s.model.gravity((-9.81,)), ["gravity", "1 number given"]),
    "gravity that is none": (lambda s: s.model.gravity((0, 0, NAN)), ["gravity", "nan"]),
    "a force that is none": (lambda s: s.model.force(s.tip, (0, NAN, 0)), ["force on tip", "tip.y", "nan"]),
    "a negative mass": (lambda s: s.beam(mass=-3.0), ["body beam", "-3 kg"]),
    "a mass that is none": (lambda s: s.beam(mass=NAN), ["body beam, mass", "nan"]),
    "a mass in words": (lambda s: s.beam(mass="heavy"), ["body beam, mass", "'heavy'"]),
    "an impossible inertia": (lambda s: s.beam(inertia=np.diag([1.0, 1.0, 3.0])), ["body beam", "1, 1, 3 kg m2", "2"]),
    "a negative inertia": (lambda s: s.beam(inertia=np.diag([1.0, 1.0, -0.5])), ["body beam", "-0.5"]),
    "an inertia that is lopsided with other parameters": (
        lambda s: s.beam(inertia=[[5, s.length, 0], [2, 5, 0], [0, 0, 5]]),
        ["body beam", "xy and yx", "only at the default of length"],
    ),
    "a lopsided inertia": (lambda s: s.beam(inertia=[[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]), ["body beam", "not symmetric"]),
    "an inertia of two numbers": (lambda s: s.beam(inertia=[1, 2]), ["body beam", "shape (2,)"]),
    "an inertia that is none": (lambda s: s.beam(inertia=np.diag([1.0, NAN, 1.0])), ["body beam", "not a finite number"]),
    "a centre in the plane": (lambda s: s.beam(com=(1, 0)), ["body beam", "(2,)"]),
    "a centre that is none": (lambda s: s.beam(com=(1, INF, 0)), ["body beam", "not a finite number"]),
    "a body twice": (lambda s: [s.beam(), s.beam()], ["body beam", "already a body"]),
    "a body with a stranger": (lambda s: s.model.body("beam", points=[s.stranger]), ["body beam", "stranger", "another model"]),
    "a basis on one line": (
        lambda s: s.model.body("beam", [s.pivot, s.tip, s.far], [s.ez], mass=1.0, basis=[s.pivot, s.tip, s.far, s.ez], inertia="point"),
        ["body beam", "pivot, tip, far, ez", "parallel or coplanar"],
    ),
    "a basis of vectors": (
        lambda s: s.model.body("beam", vectors=[s.ex, s.ez], mass=1.0, inertia="point"),
        ["body beam", "at least one point"],
    ),
    "a basis without anything": (lambda s: s.model.body("beam", mass=1.0), ["body beam", "at least one point"]),
    "an independent coordinate that is none": (lambda s: s.model.independent("psi"), ["independent, coordinates", "no coordinate psi"]),
    "an independent coordinate that is fixed": (lambda s: s.model.independent("pivot.x"), ["pivot.x", "not a free coordinate"]),
}

# Mistakes that only the generator can see.
LATE_MISTAKES = {
    "an unknown symbol in a force": (lambda s: s.model.force(s.tip, (sympy.Symbol("breeze"), 0, 0)), ["force on tip", "breeze"]),
    "an unknown symbol in a potential": (lambda s: s.model.potential(sympy.Symbol("hill") ** 2, "slope"), ["slope", "hill"]),
    "an unknown symbol in a row": (lambda s: s.model.constrain(s.tip.x - sympy.Symbol("gap"), "stop"), ["constraint 1 (stop)", "gap"]),
    "an unknown symbol in a law": (lambda s: s.model.drive(s.tip.x, sympy.Symbol("omega") * s.model.time), ["tip.x", "omega"]),
    "another model's coordinate": (lambda s: s.model.constrain(s.tip.x - s.stranger.x, "tie"), ["constraint 1 (tie)", "stranger.x"]),
    "a centre beside the bar": (
        lambda s: s.model.body("rod", points=[s.tip, s.far], mass=1.0, com=(3, 0.1, 0), inertia="point"),
        ["body rod", "not on the line"],
    ),
    "a bar that is not round": (
        lambda s: s.model.body("rod", points=[s.tip, s.far], mass=1.0, inertia=np.diag([0.0, 1.0, 2.0]) + np.eye(3)),
        ["body rod", "symmetric about their line"],
    ),
    "a point mass with an arm": (
        lambda s: s.model.body("bob", points=[s.tip], mass=1.0, com=(2, 0, 0.1)),
        ["body bob", "point mass"],
    ),
}

# Mistakes that are not told as they should be, on their line or when the model is generated.
MISSED = {
    "a parameter named like a coordinate": (lambda s: s.model.parameter("tip.x", 1.0), ["tip.x"]),
    "a point whose coordinates are taken": (
        lambda s: [s.model.parameter("nose.x", 1.0), s.model.point("nose", (0, 0, 0))],
        ["point nose"],
    ),
    "an angle named like time": (lambda s: s.model.angle("t", s.ex, s.ex, s.ez), ["angle t"]),
    "a parameter named like time": (lambda s: s.model.parameter("t", 1.0), ["parameter t"]),
    "a point held along no axis": (lambda s: s.model.point("loose", (0, 0, 0), fixed="w"), ["point loose", "w"]),
    "a force of two numbers": (lambda s: s.model.force(s.tip, (1, 0)), ["force on tip", "2"]),
    "a position that is no list": (lambda s: s.model.point("loose", 3.0), ["point loose"]),
    "lengths without a number": (lambda s: s.model.angle("psi", s.ex, s.ex, s.ez, lengths=(1, NAN, 1)), ["angle psi", "nan"]),
    "a cosine that is none": (lambda s: s.model.vector_vector(s.ex, s.ez, NAN), ["ex", "nan"]),
    "an infinite force": (lambda s: s.model.force(s.tip, (sympy.oo, 0, 0)), ["force on tip"]),
    "an inertia in words": (lambda s: s.beam(inertia="heavy"), ["body beam"]),
    "a driver of another model": (lambda s: s.model.drive(s.stranger.x, 0), ["stranger.x", "another model"]),
    "an expression outside its domain": (lambda s: s.model.force(s.tip, (sympy.sqrt(s.pivot.x - 1), 0, 0)), ["force on tip"]),
    "an expression that overflows": (lambda s: s.model.force(s.tip, (sympy.exp(s.pivot.x + 1000), 0, 0)), ["force on tip"]),
    "a division by a fixed zero": (lambda s: s.model.force(s.tip, (s.tip.x / s.pivot.x, 0, 0)), ["force on tip"]),
    "a number beyond the doubles": (lambda s: s.model.force(s.tip, (s.tip.x / sympy.Float(1e-310), 0, 0)), ["force on tip", "finite"]),
    "a function that is none": (lambda s: s.model.force(s.tip, (sympy.gamma(s.tip.x.symbol), 0, 0)), ["force on tip", "gamma(tip.x)"]),
    "a row with a function that is none": (lambda s: s.model.constrain(sympy.gamma(s.tip.x.symbol), "stop"), ["stop", "gamma(tip.x)"]),
}


def refused(act, words):
    """act() raises a ModelError of one line that contains the words and leaves the command line with 2."""
    with pytest.raises(ModelError) as caught:
        act()
    message = str(caught.value)
    assert "\n" not in message and caught.value.exit_code == 2
    assert [word for word in words if word not in message] == []


@pytest.mark.parametrize("mistake", MISTAKES)
def test_refused_on_the_line_that_makes_it(mistake):
    """Type, one line, the name that the user gave, and the number that is wrong."""
    act, words = MISTAKES[mistake]
    scene = Scene()
    refused(lambda: act(scene), words)


@pytest.mark.parametrize("mistake", LATE_MISTAKES)
def test_refused_when_generated(mistake):
    """What the line cannot know is refused by generate(), in the same manner."""
    act, words = LATE_MISTAKES[mistake]
    scene = Scene()
    act(scene)
    refused(lambda: ncgen.generate(scene.model), words)


@pytest.mark.parametrize("mistake", MISSED)
def test_refused_some_day(mistake):
    """The same for mistakes that are not told as they should be."""
    act, words = MISSED[mistake]
    scene = Scene()
    refused(lambda: [act(scene), ncgen.generate(scene.model)], words)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_refused_thing_leaves_no_trace(mistake):
    """After a refusal the model is as it was before: nothing half-made can be generated."""
    act, _ = MISTAKES[mistake]
    if mistake == "a body twice":
        return
    scene, before = Scene(), Scene()
    with pytest.raises(ModelError):
        act(scene)
    assert repr(scene.model) == repr(before.model)
    assert list(scene.model.elements) == list(before.model.elements)
    assert list(scene.model.parameters) == list(before.model.parameters)


def test_almost_a_mistake_is_none():
    """Just inside the limits everything is accepted."""
    scene = Scene()
    scene.model.vector("almost", (1 + 1e-10, 0, 0))
    scene.model.vector_vector(scene.ex, scene.ez, math.cos(2e-6))
    scene.model.angle("psi", scene.ex, scene.side - scene.pivot, scene.ez)
    scene.model.point("loose", (0, 0, -0.0), fixed="xy")
    scene.beam(mass=0.0, inertia=np.diag([1.0, 2.0, 3.0]))


# -- the paper's tables -------------------------------------------------------------------------


def table_case(change):
    """The robot's tables with one change: change(P, U, rows, inertia, options)."""

    def build(tables):
        P, U, rows = tables.P.copy(), tables.U.astype(float), copy.deepcopy(tables.RIGID + tables.ANGLES)
        inertia, options = copy.deepcopy(tables.INERTIA), {}
        change(P, U, rows, inertia, options)
        Model.from_tables(P, U, rows, inertia=inertia, **options)

    return build


def put(what, *path):
    """A change: what[path[0]][path[1]]… = path[-1], where `what` counts P, U, rows, inertia, options."""

    def change(*tables):
        place = tables[what]
        for step in path[:-2]:
            place = place[step]
        place[path[-2]] = path[-1]

    return table_case(change)


P, U, ROWS, INERTIA, OPTIONS = range(5)
PARAMETER = Model("other").parameter("L", 1.0)
TABLE_MISTAKES = {
    "nan in P": (put(P, 3, 1, NAN), ["point r4, y", "nan"]),
    "nan in U": (put(U, 0, 2, NAN), ["vector u1, z", "nan"]),
    "a long vector in U": (put(U, 3, 0, 1.5), ["vector u4", "1.5"]),
    "nan in CONSTR": (put(ROWS, 0, 11, NAN), ["CONSTR row 1, column 12", "nan"]),
    "infinity in CONSTR": (put(ROWS, 27, 9, INF), ["CONSTR row 28, column 10", "inf"]),
    "nan as a number of a point": (put(ROWS, 1, 1, NAN), ["CONSTR row 2, column 2", "nan"]),
    "nan as mass": (put(INERTIA, 3, "m", NAN), ["body body3, mass", "nan"]),
    "a negative mass": (put(INERTIA, 3, "m", -1.0), ["body body3", "-1 kg"]),
    "an impossible inertia": (put(INERTIA, 2, "IT", np.diag([1.0, 1.0, 5.0])), ["body body2", "1, 1, 5 kg m2"]),
    "a missing point in CONSTR": (put(ROWS, 1, 1, 9), ["CONSTR row 2", "point 9 does not exist", "8"]),
    "point zero": (put(ROWS, 1, 2, 0), ["CONSTR row 2", "point 0"]),
    "a missing vector": (put(ROWS, 3, 1, 6), ["CONSTR row 4", "vector 6 does not exist", "5"]),
    "a missing point of a body": (put(INERTIA, 4, "r", [3, 12]), ["inertia of body 4", "point 12"]),
    "half a point": (put(ROWS, 1, 1, 1.5), ["CONSTR row 2", "point 1.5"]),
    "an unknown code": (put(ROWS, 5, 0, 1004), ["CONSTR row 6", "code 1004", "1000", "1015"]),
    "the paper's 1001.5": (put(ROWS, 5, 0, 1001.5), ["CONSTR row 6", "code 1001.5"]),
    "eleven columns": (put(ROWS, 7, [1000, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0]), ["CONSTR row 8", "11 entries", "12"]),
    "the printed slip of row 7": (put(ROWS, 6, [1003, 1.3, 0, 0, 0, 0, 0, 0, 0, 0, 0]), ["CONSTR row 7", "11 entries"]),
    "a length of zero": (put(ROWS, 0, 11, 0.0), ["distance r1-r2", "0 m"]),
    "a segment without length": (put(ROWS, 4, 10, 0), ["angle u3", "r1-r2", "0 m"]),
    "an angle of 0": (put(ROWS, 6, 11, 1.0), ["u1", "u3", "cosine is 1"]),
    "an angle of pi": (put(ROWS, 4, 11, -1), ["u3", "r1-r2", "cosine is -1", "pi"]),
    "a number twice": (put(ROWS, 26, 11, 1), ["angle psi1", "already used"]),
    "a position in q twice": (put(P, 2, 3, 19), ["r3", "position in q is 19", "16"]),
    "an angle that is not there": (put(OPTIONS, "independent", [1, 7]), ["psi7"]),
    "two columns in P": (lambda t: Model.from_tables(t.P[:, :2], t.U, []), ["r1", "2 numbers"]),
    "an unknown line": (put(OPTIONS, "lines", [[1, 10]]), ["LINES", "point 10"]),
    "a list as a number of a point": (put(ROWS, 1, 1, [2]), ["CONSTR row 2", "[2]", "number of a point"]),
    "a parameter as a number of a point": (put(ROWS, 1, 2, PARAMETER), ["CONSTR row 2", "parameter L", "number of a point"]),
    "a parameter as the number of an axis": (put(ROWS, 27, 5, PARAMETER), ["CONSTR row 28", "parameter L", "number of a vector"]),
    "a list as the number of an angle": (put(ROWS, 27, 11, [3]), ["CONSTR row 28", "[3]", "number of an angle"]),
    "a list as a code": (put(ROWS, 5, 0, [1000]), ["CONSTR row 6", "[1000]"]),
    "a parameter as a position in q": (lambda t: Model.from_tables([(0, 0, 0, PARAMETER)], [], []), ["r1", "parameter L", "position in q"]),
    "a list as a fixed position": (lambda t: Model.from_tables(t.P, t.U, [], fixed=[[1]]), ["fixed", "[1]", "position in q"]),
    "a parameter in LINES": (lambda t: Model.from_tables(t.P, t.U, [], lines=[(1, PARAMETER)]), ["LINES", "parameter L"]),
    "a list in the inertia of a body": (
        lambda t: Model.from_tables(t.P, t.U, [], inertia={1: {"m": 1.0, "cog": (0, 0, 0), "IT": 1.0, "r": [[1], 2]}}),
        ["inertia of body 1", "[1]", "number of a point"],
    ),
    "an unknown arrow": (put(OPTIONS, "uvect", [[1, 7]]), ["UVECT", "vector 7"]),
}
TABLE_MISSED = {
    "a body without mass": (table_case(lambda p, u, r, i, o: i[2].pop("m")), ["body 2", "m"]),
    "a position that is fixed nowhere": (put(OPTIONS, "fixed", [99]), ["99"]),
    "words in CONSTR": (put(ROWS, 1, 1, "two"), ["CONSTR row 2", "two"]),
}


@pytest.mark.parametrize("mistake", TABLE_MISTAKES)
def test_refused_in_a_table(robot_tables, mistake):
    """A mistake in one entry of the robot's tables is told by table, row and entry."""
    build, words = TABLE_MISTAKES[mistake]
    refused(lambda: build(robot_tables), words)


@pytest.mark.parametrize("mistake", TABLE_MISSED)
def test_refused_in_a_table_some_day(robot_tables, mistake):
    """The same for mistakes that are not told as they should be."""
    build, words = TABLE_MISSED[mistake]
    refused(lambda: build(robot_tables), words)
