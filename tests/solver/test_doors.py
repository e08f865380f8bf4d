"""One question at every door: the same wrong argument is refused everywhere, in the same words."""

from __future__ import annotations

import inspect
import re

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError, NcgenError
from ncgen.model import Model
from ncgen.solver.runs.simulation_options import check_simulation


def swing() -> Model:
    """A pendulum on a spring, with two parameters."""
    m = Model("swing")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    k, c = m.parameter("k", 10.0), m.parameter("c", 0.1)
    m.body("bob", points=[B], mass=1.0)
    m.distance(A, B)
    m.spring(B, m.point("G", (0.5, -1), fixed=True), stiffness=k, damping=c)
    m.gravity((0, -9.81, 0))
    return m


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(swing(), "c")


def nothing(q, qd):
    return 0.0, None, None


def the_check(kernels, duration=1.0, **given):
    """What `ncgen check` and the command line do before anything is compiled."""
    m = swing()
    m.simulation(duration=duration, **given)
    return check_simulation(m)


def batch(kernels, duration=1.0, **given):
    return ncgen.simulate(kernels, duration, zd0=given.pop("zd0", np.zeros((2, 1))), **given)


DOORS = {
    "simulate": lambda k, duration=1.0, **given: ncgen.simulate(k, duration, **given),
    "simulate in Python": lambda k, duration=1.0, **given: ncgen.simulate(k, duration, engine="python", **given),
    "simulate rows": batch,
    "sensitivities": lambda k, duration=1.0, **given: ncgen.sensitivities(k, duration, 5, **given),
    "gradient": lambda k, duration=1.0, **given: ncgen.gradient(k, duration, 5, nothing, **given),
    "check": the_check,
}
ALL = tuple(DOORS)
RUNS = ("simulate", "simulate in Python", "simulate rows", "check")
SINGLE = ("simulate", "simulate in Python", "sensitivities", "gradient", "check")

WRONG = [
    (ALL, {"duration": -1.0}, "duration: -1.0 given; it must be a positive number of seconds"),
    (ALL, {"duration": np.nan}, "duration: nan given; it must be a positive number of seconds"),
    (ALL, {"duration": "long"}, "duration: 'long' given; it must be a positive number of seconds"),
    (ALL, {"duration": True}, "duration: True given; it must be a positive number of seconds"),
    (ALL, {"t0": np.inf}, "t0 is inf; it must be a finite number"),
    (ALL, {"z": "nope"}, "z: the mechanism has no free coordinate nope; it has B.x, B.y"),
    (ALL, {"z": ("B.x", "B.x")}, "z: B.x is named twice; name it once"),
    (ALL, {"p": {"kk": 1.0}}, "p: the mechanism has no parameter kk; it has k, c"),
    (SINGLE, {"p": [1.0]}, "p: 1 number given, 2 needed: k, c"),
    (SINGLE, {"p": {"k": np.nan}}, "p: k is nan; it must be a finite number"),
    (SINGLE, {"q0": [1.0]}, "q0: 1 number given, 2 needed: B.x, B.y"),
    (SINGLE, {"zd0": {"nope": 1.0}}, "zd0: the mechanism has no free coordinate nope; it has B.x, B.y"),
    (RUNS, {"rtol": -1}, "rtol: -1 given; it must be a positive number"),
    (RUNS, {"atol": np.nan}, "atol: nan given; it must be a positive number"),
    (RUNS, {"points": 2.5}, "points: 2.5 given; a trajectory has at least 2"),
    (RUNS, {"points": 1}, "points: 1 given; a trajectory has at least 2"),
    (RUNS, {"points": 10**12}, "points: 1000000000000 instants of 2 coordinates take 5.22e+04 GiB; ask for fewer"),
    (RUNS, {"max_step": 0.0}, "max_step: 0.0 given; it must be a positive number of seconds"),
    (RUNS, {"max_step": 1e-300}, "max_step: 1e-300 s cannot be distinguished at t = 1 s; take a longer one"),
    (RUNS, {"integrator": "rk4"}, "max_step: rk4 has a fixed step; give its length in seconds"),
    (RUNS, {"integrator": "rk4", "max_step": 1e-12}, "max_step: 1e-12 s makes 1e+12 steps; 1e+09 are the limit, take a longer one"),
    (RUNS, {"t0": 1e16, "duration": 0.05, "points": 3}, None),
]


@pytest.mark.parametrize(("doors", "given", "said"), WRONG, ids=[str(given) for _, given, _ in WRONG])
def test_the_same_words_at_every_door(kernels, doors, given, said):
    """One sentence for one mistake, whatever is asked."""
    sentences = {}
    for door in doors:
        with pytest.raises(ModelError) as refused:
            DOORS[door](kernels, **given)
        sentences[door] = str(refused.value)
    assert len(set(sentences.values())) == 1, sentences
    (sentence,) = set(sentences.values())
    assert "\n" not in sentence and len(sentence) <= 300
    if said is not None:
        assert sentence == said


@pytest.mark.parametrize("unknown", ["integrator", "formalism", "engine", "number"])
def test_unknown_words_list_the_known_ones(kernels, unknown):
    with pytest.raises(ModelError, match=f"{unknown} '?magic'? is unknown; choose one of "):
        ncgen.simulate(kernels, 1.0, **{unknown: "magic"})


def test_parameters_by_name_and_in_order_are_the_same(kernels):
    one, other = (ncgen.simulate(kernels, 0.5, p=p) for p in ({"k": 20.0}, [20.0, 0.1]))
    assert np.array_equal(one.q, other.q) and not np.allclose(one.q[-1], ncgen.simulate(kernels, 0.5).q[-1])


@pytest.mark.parametrize("engine", ["c", "python"])
@pytest.mark.parametrize(
    "formalism", ["coordinate-partitioning", "lagrange", "null-space", "augmented-lagrangian", "udwadia-phohomsiri", "penalty"]
)
def test_a_fixed_step_is_needed_whatever_the_formalism(kernels, formalism, engine):
    """One step an output row was taken without a word."""
    with pytest.raises(ModelError, match="max_step: rk4 has a fixed step; give its length in seconds"):
        ncgen.simulate(kernels, 0.5, formalism=formalism, integrator="rk4", points=2, engine=engine)


def test_a_model_is_no_kernels():
    with pytest.raises(ModelError, match="kernels needed, .* given; ncgen.compile"):
        ncgen.linearise(3)
    with pytest.raises(ModelError, match="kernels needed, <Model swing.* given; ncgen.compile"):
        ncgen.simulate(swing(), 1.0)


NEEDED = {"duration": 1.0, "steps": 10, "to": "c", "output": "nowhere", "vary": {}, "keep": "angle"}
"""Further arguments of the public functions that cannot do without them."""

OF_EXPRESSIONS = {"free", "impact", "lock", "smooth_step"}
"""Public functions that take numbers, names and expressions."""

DOORS_OF_MODELS = sorted(
    name
    for name in {*ncgen.__all__} - OF_EXPRESSIONS
    if inspect.isfunction(getattr(ncgen, name)) and inspect.signature(getattr(ncgen, name)).parameters
)


@pytest.mark.parametrize("given", ["robot", None, 3], ids=str)
@pytest.mark.parametrize("door", DOORS_OF_MODELS)
def test_what_is_neither_model_nor_kernels(door, given):
    """One line at every public function, and what is needed in its place."""
    function = getattr(ncgen, door)
    if isinstance(given, str) and door in ("load", "read"):
        given = given.encode()
    first, *others = inspect.signature(function).parameters.values()
    others = {p.name: NEEDED.get(p.name, 1.0) for p in others if p.default is p.empty and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)}
    with pytest.raises(NcgenError, match=re.escape(str(given))) as refused:
        function(given, **others)
    assert "\n" not in str(refused.value) and ("needed" in str(refused.value) or "give " in str(refused.value))
