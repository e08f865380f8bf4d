"""Every argument of every builder method is refused in one line where it is wrong; names work where things do."""

from __future__ import annotations

import inspect
import math

import numpy as np
import pytest
import sympy

import ncgen
from ncgen import Model, ModelError
from ncgen.model.argument_readers import READERS
from ncgen.model.bodies import Body
from ncgen.model.elements import Element


class Scene:
    """Bodies, points, axes and angles to call every method with."""

    def __init__(self, name="scene"):
        m = self.model = Model(name)
        self.O, self.A = m.point("O", (0, 0, 0), fixed=True), m.point("A", (1, 0, 0))
        self.B, self.C = m.point("B", (2, 0, 0)), m.point("C", (1, 1, 0.5))
        self.D = m.point("D", (3, 0, 0))
        self.u, self.v = m.vector("u", (1, 0, 0)), m.vector("v", (0, 0, 1))
        self.w = m.vector("w", (0, 1, 0), fixed=True)
        self.rod = m.body("rod", [self.A, self.C], [self.v])
        self.arm = m.body("arm", [self.B, self.D], [self.w])
        self.psi, self.phi = m.angle("psi", self.u, self.w, self.v), m.angle("phi", self.w, self.u, self.v)
        self.s = m.length("s", self.A, self.C)
        self.k = m.parameter("k", 2.0)


def calls(s) -> dict[str, dict]:
    """A right call of every method."""
    joint = {"a": s.rod, "b": s.arm}
    return {
        "parameter": {"name": "new", "default": 1.0, "unit": "m"},
        "input": {"name": "new", "unit": "N m", "default": 1.0},
        "output": {"label": "height", "expression": s.A.x, "unit": "m"},
        "spline": {"name": "new", "knots": (0, 1, 2), "values": (0, 1, 0.5), "end": "clamped"},
        "table": {"name": "new", "knots": (0, 1, 2), "values": (0, 1, 0.0), "periodic": True},
        "point": {"name": "new", "position": (1, 2, 3), "fixed": "z"},
        "vector": {"name": "new", "direction": (0, 0.6, 0.8), "fixed": False},
        "angle": {"name": "new", "start": s.u, "end": s.w, "axis": s.v, "form": "sine", "lengths": (1, 1, 1), "initial": 1.5},
        "length": {"name": "new", "start": s.A, "end": s.B, "initial": 1.0},
        "range": {"number": "A.position.x", "low": 0.5, "high": 1.5},
        "slide": {"name": "new", "start": s.A, "end": s.B, "axis": s.u},
        "independent": {"coordinates": [s.psi]},
        "body": {
            "name": "new", "points": [s.A, s.B], "vectors": [s.v], "mass": 1.0, "com": (1, 0, 0), "inertia": (1, 1, 1),
            "basis": [s.A, s.B, s.v], "rigid": True, "constant_mass": False, "as_given": False,
        },
        "extend": {"body": s.rod, "elements": [s.B]},
        "attach_point": {"body": s.rod, "name": "new", "position": (4, 4, 4)},
        "attach_vector": {"body": s.rod, "name": "new", "direction": (0, 0.6, 0.8)},
        "distance": {"start": s.A, "end": s.B, "length": 1.0, "owner": s.rod},
        "unit": {"vector": s.u, "owner": s.rod},
        "vector_segment": {"vector": s.v, "segment": s.B - s.A, "length": 1.0, "cosine": 0.0, "owner": s.rod},
        "vector_vector": {"u": s.u, "v": s.v, "cosine": 0.0, "owner": s.rod},
        "constrain": {"expression": s.A.x - 1, "label": "mine", "owner": s.rod},
        "constrain_velocity": {"expression": s.A.x.rate, "label": "mine", "owner": s.rod},
        "drive": {"coordinate": s.psi, "law": s.model.time},
        "spherical": {**joint, "point": s.A},
        "revolute": {**joint, "point": s.A, "axis": s.v},
        "universal": {**joint, "point": s.A, "u": s.v, "v": s.w},
        "cylindrical": {**joint, "start": s.A, "end": s.B, "axis": s.u},
        "prismatic": {**joint, "start": s.A, "end": s.B, "axis": s.u},
        "slider": {**joint, "start": s.A, "end": s.B, "axis": s.u},
        "planar": {**joint, "start": s.A, "end": s.B, "normal": s.v},
        "screw": {**joint, "start": s.A, "end": s.B, "axis": s.u, "pitch": 0.01, "name": "new"},
        "rigid": joint,
        "point_on_line": {"a": s.rod, "point": s.B, "start": s.A, "axis": s.u},
        "point_in_plane": {"a": s.rod, "point": s.B, "start": s.A, "normal": s.v, "owner": s.arm},
        "gear": {"first": s.psi, "second": s.phi, "radius_first": 1.0, "radius_second": 2.0},
        "follow": {"coordinate": s.psi, "other": s.phi, "ratio": 2.0, "offset": 0.1},
        "rack": {"slide": s.s, "angle": s.psi, "radius": 0.1},
        "event": {"name": "new", "when": s.A.x - 1, "direction": "rising", "do": {"k": 1.0}},
        "stop": {
            "coordinate": s.psi, "lower": -1.0, "upper": 1.0, "restitution": 0.5, "stiffness": 10.0, "damping": 0.1, "exponent": 1.5,
            "name": "new",
        },
        "rope": {"start": s.A, "end": s.B, "length": 2.0, "restitution": 0.5, "order": "in turn", "name": "new"},
        "strut": {"start": s.A, "end": s.B, "length": 0.1, "restitution": 0.5, "order": "in turn", "name": "new"},
        "friction": {"coordinate": s.psi, "coulomb": 1.0, "static": 2.0, "viscous": 0.1, "stribeck": 0.01, "other": s.A.x, "ratio": 2.0,
                     "name": "new"},
        "backlash": {"coordinate": s.psi, "other": s.A.x, "width": 0.1, "ratio": 2.0, "restitution": 0.5, "stiffness": 10.0,
                     "damping": 0.1, "order": "in turn", "name": "new"},
        "ratchet": {"coordinate": s.psi, "other": s.A.x, "ratio": 2.0, "direction": "falling", "pitch": 0.1, "order": "in turn",
                    "name": "new"},
        "lock": {"coordinate": s.psi, "when": s.A.x - 1, "until": s.model.time - 1, "name": "new"},
        "clutch": {"coordinate": s.psi, "other": s.A.x, "ratio": 2.0, "when": s.A.x - 1, "until": s.model.time - 1, "closed": False,
                   "name": "new"},
        "contact": {
            "name": "new", "body": s.rod, "point": s.A, "on": s.arm, "at": s.B, "radius": 0.1, "around": 0.2, "axis": s.w, "inside": True,
            "friction": 0.3, "restitution": 0.5, "tangential": 0.1, "law": "newton", "order": "in turn", "rest": "hold",
        },
        "gap_contact": {
            "name": "new", "gap": s.A.z + 1.0, "sliding": s.A.x.rate, "friction": 0.3, "restitution": 0.5, "tangential": 0.1,
            "law": "newton", "order": "in turn", "rest": "hold",
        },
        "rolling": {"disc": s.rod, "centre": s.A, "axle": s.u, "across": s.w, "radius": 1.0, "normal": (0.0, 0.0, 1.0)},
        "gravity": {"field": (0, 0, -9.81)},
        "force": {"point": s.A, "vector": (1, 2, 3), "label": "mine"},
        "torque": {"coordinate": s.psi, "expression": 1.0, "label": "mine"},
        "rotor": {"coordinate": s.psi, "inertia": 0.1},
        "payload": {"body": s.rod, "name": "load", "mass": 1.0, "com": (1, 0, 0), "inertia": 0.1, "basis": None, "as_given": False},
        "couple": {"body": s.rod, "vector": (1, 2, 3), "label": "mine"},
        "polynomial_spring": {"angle": s.psi, "stiffness": (1.0, 0.2), "damping": (2.0, 0.1, 0.3), "free_angle": 1.0, "label": "mine"},
        "ball_spring": {
            "parent": s.rod, "child": s.arm, "stiffness": (1.0, 0.2), "damping": (2.0, 0.1, 0.3),
            "axes": [(0, 0, 1), (1, 0, 0), (0, 1, 0)], "label": "mine",
        },
        "anchor_spring": {"body": s.rod, "position": (1, 0, 0), "stiffness": (1.0,), "damping": (2.0, 0.1, 0.3), "label": "mine"},
        "constant_force": {"body": s.rod, "position": (1, 0, 0), "vector": (1, 2, 3), "label": "mine"},
        "potential": {"expression": s.A.x**2, "label": "mine"},
        "spring": {"start": s.A, "end": s.B, "stiffness": 1.0, "damping": 2.0, "free_length": 1.0, "law": None, "label": "mine"},
        "torsion_spring": {"angle": s.psi, "stiffness": 1.0, "damping": 2.0, "free_angle": 1.0, "law": None, "label": "mine"},
        "callback": {"function": print},
        "line": {"points": [s.A, s.B]},
        "arrow": {"point": s.A, "vector": s.u},
        "box": {"body": s.rod, "size": (1, 2, 3), "position": (0, 0, 1), "rotation": (0, 0, 1.5), "colour": "#ff8800"},
        "cylinder": {"body": s.rod, "radius": 1.0, "length": 2.0, "position": (0, 0, 1), "axis": (0, 0, -1), "colour": "#ff8800"},
        "capsule": {"body": s.rod, "radius": 1.0, "length": 2.0, "position": (0, 0, 1), "axis": (0, 2, 0), "colour": "#ff8800"},
        "wheel": {"body": s.rod, "radius": 1.0, "width": 0.2, "position": (0, 0, 1), "axis": (1, 0, 0), "colour": "#ff8800"},
        "sphere": {"body": s.rod, "radius": 1.0, "position": (0, 0, 1), "colour": "#ff8800"},
        "ellipsoid": {"body": s.rod, "radii": (1, 2, 3), "position": (0, 0, 1), "rotation": (0, 0, 1.5), "colour": "#ff8800"},
        "polygon": {"body": s.rod, "corners": [(0, 0, 1), (1, 0, 1), (1, 1, 1)], "thickness": 0.1, "colour": "#ff8800"},
        "mesh": {
            "body": s.rod, "file": "rod.stl", "position": (0, 0, 1), "rotation": (0, 0, 1.5), "scale": (1, 1, -1), "colour": "#ff8800"
        },
        "bar": {"start": s.A, "end": s.B, "radius": 0.1, "colour": "#ff8800"},
        "telescope": {"start": s.A, "end": s.B, "radius": 0.1, "length": 0.5, "colour": "#ff8800"},
    }  # fmt: skip


NO_NUMBERS = [
    None,
    "2 m",
    b"2",
    2j,
    math.nan,
    math.inf,
    -math.inf,
    True,
    [1.0],
    np.ones(1),
    np.ones((2, 2)),
    {},
    object(),
    np.complex128(1),
]
NO_NUMBERS += [sympy.Symbol("nobody"), sympy.I, sympy.nan, sympy.zoo, sympy.Symbol("k") < 1, np.array("x"), 10**400]
NO_THINGS = [None, "nobody", 7, 2.5, math.nan, True, [], {}, object(), np.ones(3), b"A"]
NO_VECTORS = [
    None,
    -9.81,
    "abc",
    "xyz",
    {1, 2, 3},
    {0: 1, 1: 2, 2: 3},
    (),
    (1,),
    (1, 2, 3, 4),
    (1, 2, None),
    (1, math.nan, 0),
    np.ones((3, 1)),
]
NO_VECTORS += [np.ones((1, 3)), (1j, 0, 0), ("1", "2", "3"), b"abc", object(), 5, ((1, 0, 0),)]
WRONG = {
    "Value": NO_NUMBERS,
    "Values": NO_VECTORS,
    "Numbers": [*NO_VECTORS, (1, sympy.Symbol("k"), 3)],
    "Expression": [*(x for x in NO_NUMBERS if not isinstance(x, sympy.Symbol)), (1, 2), np.ones(3)],
    "Driven": [*(x for x in NO_NUMBERS if not isinstance(x, sympy.Symbol)), (1, 2), np.ones(3)],
    "Number": NO_NUMBERS,
    "str": [None, 5, True, [], b"new", 2.5, object()],
    "bool": ["yes", 1, 0.0, [], object(), None],
    "Sequence[Numbers]": [
        None,
        5,
        "abc",
        b"abc",
        {},
        {1, 2},
        [1, 2, 3],
        [(1, 2, 3)],
        [(1, 2), (3, 4), "ab"],
        [(0, 0, math.nan)] * 3,
        object(),
    ],
    "bool | str": [1, 2.5, ["z"], object(), None, "w"],
    "Sequence[Point]": [*NO_THINGS[:6], "nobody", {"A": 1}, [None], [3], ["nobody"], [["A"]]],
    "Sequence[Vector]": [*NO_THINGS[:6], "nobody", [None], ["nobody"]],
    "Sequence[Spatial]": [3, "nobody", [None], ["nobody"]],
    "Direction": [*NO_THINGS, "psi"],
    "Component | Relative": [*NO_THINGS, "A", "O.x"],
}
UNANNOTATED = {
    ("independent", "coordinates"): [[None], ["nobody"], [3], ["O.x"], [[]]],
    ("force", "vector"): NO_VECTORS,
    ("couple", "vector"): NO_VECTORS,
    **{
        (word, key): [each for each in NO_VECTORS if not (isinstance(each, tuple) and len(each) == 1 and each[0] == 1)]
        for word in ("polynomial_spring", "ball_spring", "anchor_spring")
        for key in ("stiffness", "damping")
    },
    ("body", "inertia"): [
        "heavy",
        (1, 2),
        math.nan,
        1j,
        (1, math.nan, 1),
        np.ones((3, 1)),
        object(),
        {},
        [[1, 0], [0, 1, 2]],
        -1.0,
        (1, 1, 3),
    ],
    ("payload", "inertia"): ["heavy", "rod", (1, 2), math.nan, 1j, {}, [[1, 0], [0, 1, 2]], -1.0, (1, 1, 3)],
    ("spring", "law"): ["100*x", 1j, math.nan, [], object(), lambda x, v: None, lambda x, v: "x"],
    ("torsion_spring", "law"): ["100*x", 1j, math.nan, []],
    ("callback", "function"): [None, 3, "print"],
}
STRANGERS = (
    "Body", "Owner", "Point", "Vector", "Spatial", "Relative", "Component | Relative", "Sequence[Point]", "Sequence[Vector]", "Value",
)  # fmt: skip


def signature(word):
    return {k: p for k, p in inspect.signature(getattr(Model, word)).parameters.items() if k != "self"}


def wrong(word, key, parameter):
    """Values that cannot be this argument."""
    kind = str(parameter.annotation).removesuffix(" | None")
    optional = kind != parameter.annotation or (word, key) in UNANNOTATED
    for value in UNANNOTATED.get((word, key), WRONG.get(kind, NO_THINGS)):
        if not (value is None and optional and word != "callback") and not (key == "elements" and isinstance(value, list)):
            yield value


def call(scene, word, arguments):
    """Variable arguments go by themselves."""
    parameters = signature(word)
    many = next((k for k, p in parameters.items() if p.kind is p.VAR_POSITIONAL), None)
    if many is None:
        return getattr(scene.model, word)(**arguments)
    given = arguments[many]
    first = [v for k, v in arguments.items() if k != many]
    return getattr(scene.model, word)(*first, *(given if isinstance(given, (list, tuple)) else [given]))


def refusal(act, what: str = "") -> str:
    """The message of a ModelError that must come; what: to be shown where none comes."""
    try:
        act()
    except ModelError as error:
        message = str(error)
    else:
        pytest.fail(f"{what} is not refused")
    assert "\n" not in message and len(message) <= 300, message
    return message


def test_every_method_is_in_the_table():
    words = {name for name, member in inspect.getmembers(Model) if getattr(member, "is_fact", False)}
    assert words - {"simulation"} == set(calls(Scene()))
    for word in calls(Scene()):
        for key, parameter in signature(word).items():
            assert str(parameter.annotation).removesuffix(" | None") in READERS or (word, key) in UNANNOTATED or key == "function", (
                word,
                key,
            )


@pytest.mark.parametrize("word", calls(Scene()))
def test_the_right_call_is_right(word):
    scene = Scene()
    call(scene, word, calls(scene)[word])


@pytest.mark.parametrize("word", calls(Scene()))
def test_wrong_arguments(word):
    """One line that names the method or what it makes, and leaves the model as it was: for every argument, all that it cannot be."""
    scene = Scene()
    right = calls(scene)[word]
    subjects = [word, str(right.get("name")), str(right.get("label")), *(getattr(x, "name", "…") for x in right.values())]
    before = (len(scene.model.rows), list(scene.model.elements), list(scene.model.bodies), len(scene.model.forces))
    for key, parameter in signature(word).items():
        for value in wrong(word, key, parameter):
            message = refusal(lambda: call(scene, word, {**right, key: value}), f"{word}({key}={value!r:.80})")
            assert any(subject in message for subject in [key, *subjects]), message
            now = (len(scene.model.rows), list(scene.model.elements), list(scene.model.bodies), len(scene.model.forces))
            assert now == before, f"{word}({key}={value!r:.80}) changed the model"


@pytest.mark.parametrize("word", calls(Scene()))
def test_things_of_another_model(word):
    """Elements, bodies and parameters of another model are refused, namesakes included."""
    scene, other = Scene(), Scene("other")
    right, strange = calls(scene)[word], calls(other)[word]
    for key, parameter in signature(word).items():
        kind = str(parameter.annotation).removesuffix(" | None")
        if kind in STRANGERS:
            value = other.k if kind == "Value" else strange[key]
            assert "another model" in refusal(lambda: call(scene, word, {**right, key: value}))  # noqa: B023


def named(thing):
    return thing.name if isinstance(thing, (Element, Body)) else thing


@pytest.mark.parametrize("word", calls(Scene()))
def test_names_work(word):
    """Whatever has a name may be given by it."""
    by_name, scene = Scene(), Scene()
    arguments = {}
    for key, value in calls(by_name)[word].items():
        arguments[key] = [named(x) for x in value] if isinstance(value, list) else named(value)
    call(by_name, word, arguments)
    call(scene, word, calls(scene)[word])
    assert [r.label for r in by_name.model.rows] == [r.label for r in scene.model.rows]
    assert [str(r.owner) for r in by_name.model.rows] == [str(r.owner) for r in scene.model.rows]


@pytest.mark.parametrize("number", [2, np.float32(2), np.int64(2), np.array(2.0), sympy.Integer(2), sympy.Rational(4, 2), 2.0])
def test_numbers_of_many_kinds(number):
    m = Model("numbers")
    A, B = m.point("A", (number, 0, 0)), m.point("B", np.array([0, number, 0], dtype=object))
    m.distance(A, B, number * 1)
    m.body("b", [A], mass=number)
    assert ncgen.compile(m, "numpy").q0.tolist() == [2, 0, 0, 0, 2, 0]


OTHERS = {
    "an argument too many": (lambda s: s.model.gravity((0, 0, 1), 3), ["gravity", "field"]),
    "an argument misspelt": (lambda s: s.model.point("new", (0, 0), fxed=True), ["point", "fxed", "fixed"]),
    "an argument missing": (lambda s: s.model.revolute("rod", "arm", "A"), ["revolute", "axis"]),
    "a driver twice": (lambda s: [s.model.drive(s.psi, 1.0), s.model.drive("psi", 2.0)], ["drive psi", "constraint 9 drives it already"]),
    "a driver of what is fixed": (lambda s: s.model.drive(s.O.x, 1.0), ["drive O.x", "fixed"]),
    "a driver of a point": (lambda s: s.model.drive("A", 1.0), ["drive", "three coordinates", "A.x"]),
    "a body joined to itself": (lambda s: s.model.revolute("rod", "rod", "A", "v"), ["body rod", "itself"]),
    "a gear with itself": (lambda s: s.model.gear("psi", "psi", 1, 1), ["gear", "psi", "itself"]),
    "a slide along two metres": (lambda s: s.model.slide("new", "A", "B", s.B - s.O), ["slide new", "length 2"]),
    "a disc that lies flat": (lambda s: s.model.rolling("rod", "A", "v", "w", 1.0), ["rolling of rod", "flat", "v"]),
    "a disc of no radius": (lambda s: s.model.rolling("rod", "A", "u", "w", 0.0), ["rolling of rod", "radius is 0 m"]),
    "a disc on a plane of no direction": (lambda s: s.model.rolling("rod", "A", "u", "w", 1.0, (0, 0, 0)), ["rolling of rod", "normal"]),
    "a disc on a long normal": (lambda s: s.model.rolling("rod", "A", "u", "w", 1.0, (0, 0, 2)), ["rolling of rod", "unit vector"]),
    "an axle along its own spoke": (lambda s: s.model.rolling("rod", "A", "u", "u", 1.0), ["rolling of rod", "perpendicular"]),
    "an inertia without mass": (lambda s: s.model.body("new", ["A"], inertia=1.0), ["body new", "no mass"]),
    "a body called ground": (lambda s: s.model.body("ground", ["A"]), ["body ground"]),
    "a cosine of two": (lambda s: s.model.vector_vector("u", "v", 2.0), ["u, v", "cosine is 2"]),
    "a negative mass by a parameter": (
        lambda s: s.model.body("new", ["A"], mass=s.model.parameter("m", -1.0)),
        ["body new", "-1 kg"],
    ),
}


@pytest.mark.parametrize("case", OTHERS)
def test_other_mistakes(case):
    act, words = OTHERS[case]
    message = refusal(lambda: act(Scene()))
    assert [word for word in words if word not in message] == [], message
