"""Splines, tables and smooth steps in expressions: against SciPy's splines, in every language, and through all that differentiates."""

from __future__ import annotations

import json
import pickle
import shutil
from pathlib import Path

import mpmath
import numpy as np
import pytest
import scipy.integrate
import sympy
from scipy.interpolate import BPoly, CubicSpline
from wasm_in_node import in_node

import ncgen
from ncgen import ModelError
from ncgen.exchange.grammar import parse_expression
from ncgen.exchange.toml_reader import model_of
from ncgen.exchange.toml_writer import to_toml
from ncgen.mechanism import recall
from ncgen.mechanism.kernel_batch import CompiledBatch
from ncgen.model.digest import digest
from ncgen.model.pieces import ENDS
from ncgen.program.ir.evaluate import evaluate

DRAW = np.random.default_rng(8)
KNOTS = np.cumsum(DRAW.uniform(0.1, 0.6, 25)) - 4.0
VALUES = np.append(DRAW.standard_normal(24), 0.0)
VALUES[-1] = VALUES[0]
COUNT = 10_000
EPS = 2.0**-52


def pushed(end: str) -> ncgen.Model:
    """Two points under forces that are all orders of a spline, a table and a smooth step, at P.x, and two of them at Q.x, too."""
    m = ncgen.Model("pushed")
    P, Q = m.point("P", (0, 0, 0)), m.point("Q", (0, 0, 0))
    m.body("p", [P], mass=1.0)
    m.body("q", [Q], mass=1.0)
    curve = m.spline("profile", KNOTS, VALUES, end)
    table = m.table("law", KNOTS, VALUES, periodic=end == "periodic")
    m.force(P, (curve(P.x), curve(P.x, 1), curve(P.x, 2)))
    m.force(Q, (curve(P.x, 3), table(P.x), ncgen.smooth_step(P.x, -2, 3)))
    return m


def expected(end: str, x: np.ndarray) -> np.ndarray:
    """SciPy's: a spline goes on straight beyond its ends unless it begins again."""
    spline, periodic = CubicSpline(KNOTS, VALUES, bc_type=end), end == "periodic"
    first, last = KNOTS[0], KNOTS[-1]
    inside = first + (x - first) % (last - first) if periodic else np.clip(x, first, last)
    beyond = x - inside if not periodic else 0.0
    orders = [spline(inside, order) for order in range(4)]
    orders[0] += beyond * orders[1]
    for order in (2, 3):
        orders[order] = np.where(beyond == 0.0, orders[order], 0.0)
    chords = np.diff(VALUES) / np.diff(KNOTS)
    table = np.interp(inside, KNOTS, VALUES) + beyond * np.where(x < first, chords[0], chords[-1])
    step = BPoly.from_derivatives([-2.0, 3.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])(np.clip(x, -2.0, 3.0))
    return np.stack([*orders, table, step], axis=-1)


def places() -> np.ndarray:
    """10,000 of them, some beyond the knots, none so near one that a rounding would choose the piece."""
    x = DRAW.uniform(KNOTS[0] - 1.0, KNOTS[-1] + 1.0, COUNT)
    turned = KNOTS[0] + (x - KNOTS[0]) % (KNOTS[-1] - KNOTS[0])
    return x[np.min(np.abs(np.concatenate([x[:, None] - KNOTS, turned[:, None] - KNOTS], axis=1)), axis=1) > 1e-9]


@pytest.mark.parametrize("end", ENDS)
def test_values_and_derivatives_are_scipys(end):
    """C, lanes and NumPy, to rounding of the largest value."""
    x = places()
    model = pushed(end)
    compiled = ncgen.compile(model)
    q = np.zeros((len(x), compiled.n))
    q[:, compiled.index["P.x"]] = x
    zero = np.zeros_like(q)
    want = expected(end, x)
    bound = 60 * EPS * np.max(np.abs(want), axis=0)
    lanes = CompiledBatch(compiled, least=0.0)
    for found in (
        compiled.batch.values("force", 0.0, q, zero, None),
        lanes.values("force", 0.0, q, zero, None),
        ncgen.compile(model, "numpy").values("force", 0.0, q, zero, compiled.p0),
    ):
        assert np.all(np.abs(found - want) < bound)
    alone = np.array([compiled.values("force", 0.0, row, row, None) for row in q[:300]])
    assert np.all(np.abs(alone - want[:300]) < bound)


def slider(force=None) -> ncgen.Model:
    """A block of 1 kg along x at s, with a spline, a table and a parameter; force(m, s, profile, law, k) acts on it."""
    m = ncgen.Model("slider")
    axis = m.vector("axis", (1, 0, 0), fixed=True)
    O, A, B = m.point("O", (0, 0), fixed=True), m.point("A", (0, 0), fixed="y"), m.point("B", (0.1, 0), fixed="y")
    s = m.slide("s", O, A, axis)
    m.body("block", [A, B], mass=1.0)
    m.independent(s)
    k = m.parameter("k", 2.0)
    profile, law = m.spline("profile", KNOTS, VALUES, "periodic"), m.table("law", (-1.0, 0.0, 2.0), (3.0, 0.0, -1.0))
    if force:
        m.torque(s, force(m, s, profile, law, k))
    return m


def forced() -> ncgen.Model:
    return slider(lambda m, s, profile, law, k: k * profile(s) + profile(3 * m.time, 1) - profile(m.time) * s.rate + law(s))


def motion(k: float, seconds: float) -> np.ndarray:
    """(s, its rate) of the same block, by SciPy."""
    spline = CubicSpline(KNOTS, VALUES, bc_type="periodic")

    def rates(t, y):
        law = 3 + -3 * (y[0] + 1) if y[0] < 0 else -y[0] / 2
        return [y[1], k * spline(y[0]) + spline(3 * t, 1) - spline(t) * y[1] + law]

    return scipy.integrate.solve_ivp(rates, (0, seconds), [0, 0], "DOP853", rtol=1e-12, atol=1e-12, max_step=1e-3).y[:, -1]


@pytest.mark.parametrize(
    "options", [{}, {"engine": "python"}, {"engine": "c"}, {"integrator": "radau"}, {"number": "long double"}], ids=str
)
def test_a_motion_under_splines_and_tables(options):
    """Over time, over a coordinate, beside a rate: every engine."""
    run = ncgen.simulate(ncgen.compile(forced()), 1.0, rtol=1e-10, points=3, **options)
    np.testing.assert_allclose([run["s"][-1], run["rate(s)"][-1]], motion(2.0, 1.0), atol=1e-7)


def test_many_states_in_lanes():
    """Each crosses knots at its own times."""
    kernels = ncgen.compile(forced())
    found = ncgen.simulate(kernels, 1.0, p={"k": np.array([1.0, 2.0, 4.0])}, integrator="dop853", rtol=1e-10)
    for k, q in zip((1.0, 2.0, 4.0), found.q[:, -1, kernels.index["s"]], strict=True):
        assert q == pytest.approx(motion(k, 1.0)[0], abs=1e-7)


def test_a_spline_drives():
    """Place, speed and acceleration are those of SciPy's spline, multiplier and all."""
    m = slider()
    m.drive("s", m.curves["profile"](2 * m.time) - m.curves["profile"](0))
    run = ncgen.simulate(ncgen.compile(m), 1.0, points=11)
    spline = CubicSpline(KNOTS, VALUES, bc_type="periodic")
    for name, order in (("s", 0), ("rate(s)", 1)):
        np.testing.assert_allclose(run[name], 2**order * spline(2 * run.t, order) - (spline(0) if order == 0 else 0), atol=1e-9)
    np.testing.assert_allclose(run.qdd[:, run.kernels.index["s"]], 4 * spline(2 * run.t, 2), atol=1e-8)


def test_a_potential_and_the_law_of_a_spring():
    """The force of a potential is the spline's slope; a law takes the table at the length."""
    m = slider()
    m.potential(m.curves["profile"](m.elements["s"].symbol))
    m.spring("O", "B", law=lambda x, v: m.curves["law"](x - 1) + 0 * v)
    kernels = ncgen.compile(m)
    q = kernels.q0 + 0.4
    slope = CubicSpline(KNOTS, VALUES, bc_type="periodic")(0.4, 1)
    found = dict(zip(kernels.coordinates, kernels.force(q, 0 * q), strict=True))
    assert found["s"] == pytest.approx(-slope, rel=1e-13) and found["B.x"] == pytest.approx(-1.5, rel=1e-13)


def test_linearised():
    """The stiffness of a force is minus the slope of its spline, and damping and the rest as they are."""
    kernels = ncgen.compile(forced())
    q, qd, place = kernels.q0 + 0.37, np.full(kernels.n, 0.5), kernels.index["s"]
    spline = CubicSpline(KNOTS, VALUES, bc_type="periodic")
    K = kernels.stiffness(q, qd, 0 * q, np.zeros(kernels.m), 0.2).toarray()
    assert K[place, place] == pytest.approx(-(2 * spline(0.37, 1) - 0.5), rel=1e-12)
    assert kernels.damping(q, qd, 0.2).toarray()[place, place] == pytest.approx(spline(0.2), rel=1e-12)


def test_sensitivities():
    """Along a motion, by a parameter that a spline is multiplied with: beside the variational equation, integrated by SciPy."""
    kernels = ncgen.compile(slider(lambda m, s, profile, law, k: k * profile(s)))
    found = ncgen.sensitivities(kernels, 0.5, 2, integrator="dop853", rtol=1e-10)
    spline = CubicSpline(KNOTS, VALUES, bc_type="periodic")

    def rates(t, y):
        s, speed, change, its_speed = y
        return [speed, 2 * spline(s), its_speed, spline(s) + 2 * spline(s, 1) * change]

    exact = scipy.integrate.solve_ivp(rates, (0, 0.5), [0, 0, 0, 0], "DOP853", rtol=1e-12, atol=1e-12, max_step=1e-3).y[:, -1]
    place, by = kernels.index["s"], found.names.index("k")
    assert [found.q_by[-1, place, by], found.qd_by[-1, place, by]] == pytest.approx(exact[2:].tolist(), rel=1e-6)


def test_complex_steps_and_many_digits():
    """Programs run on any numbers: the imaginary part is SciPy's derivative, and 50 digits are the floats' to rounding."""
    kernels = ncgen.compile(pushed("natural"), "numpy")
    program, spline = kernels.programs.programs["force"], CubicSpline(KNOTS, VALUES, bc_type="natural")
    place = kernels.index["P.x"]
    for x in DRAW.uniform(KNOTS[0], KNOTS[-1], 50):
        q = [complex(x, 1e-200) if k == place else 0j for k in range(kernels.n)]
        moved = evaluate(program, {"t": 0.0, "q": q, "qd": [0j] * kernels.n, "p": []}, number=complex)
        assert [f.imag * 1e200 for f in moved[:3]] == pytest.approx([float(spline(x, o)) for o in (1, 2, 3)], rel=1e-10, abs=1e-10)
        exact = evaluate(
            program, {"t": 0, "q": [mpmath.mpf(v.real) for v in q], "qd": [mpmath.mpf(0)] * kernels.n, "p": []}, {}, mpmath.mpf
        )
        assert [float(f) for f in exact] == pytest.approx([f.real for f in moved], rel=1e-13, abs=1e-13)


SCRIPT = """
for (const x of PLACES) {
  view.fill(0, at, at + 24);
  view[at + PLACE] = x;
  w.pushed_force(0, 8 * at, 8 * (at + 8), 8 * (at + 16), 8 * (at + 16));
  found.push(Array.from(view.slice(at + 16, at + 22)));
}
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
@pytest.mark.parametrize("end", ["natural", "periodic"])
def test_webassembly_has_the_same_bits(end, tmp_path):
    """As plain Python, where nothing is fused; NaN stays one."""
    kernels = ncgen.compile(pushed(end), "numpy")
    program, place = kernels.programs.programs["force"], kernels.index["P.x"]
    x = [*places()[:500].tolist(), *KNOTS.tolist()]
    script = SCRIPT.replace("PLACES", json.dumps(x)).replace("PLACE", str(place))
    for at, found in zip(x, in_node([program], "pushed", script, tmp_path), strict=True):
        q = [at if k == place else 0.0 for k in range(kernels.n)]
        assert found == evaluate(program, {"t": 0.0, "q": q, "qd": q, "p": []})


def test_knots_belong_to_the_piece_behind_them():
    """At a knot the derivatives are those from above, in every language; beyond the last it goes on straight."""
    kernels = [ncgen.compile(pushed("natural"), backend) for backend in ("c", "numpy")]
    want = expected("natural", np.append(KNOTS[:-1], KNOTS[-1] + 1))
    want[:-1, 4] = VALUES[:-1]
    for each in kernels:
        for x, row in zip([*KNOTS[:-1], KNOTS[-1] + 1], want, strict=True):
            q = np.zeros(each.n)
            q[each.index["P.x"]] = x
            np.testing.assert_allclose(each.values("force", 0.0, q, q, each.p0), row, atol=60 * EPS * np.max(np.abs(want)))


def test_a_number_that_is_none_stays_none():
    for backend in ("c", "numpy"):
        kernels = ncgen.compile(pushed("periodic"), backend)
        q = np.full(kernels.n, np.nan)
        with np.errstate(invalid="ignore"):
            assert np.all(np.isnan(kernels.values("force", 0.0, q, q, kernels.p0)[:3]))


def test_files_travel_and_recall():
    """To the same bytes through a file, through pickle, and as programs that are kept as data."""
    m = forced()
    m.output("curve", m.curves["profile"](m.elements["s"].symbol, 2))
    m.torque("s", ncgen.smooth_step(m.time, 1, 2) - sympy.Max(m.curves["law"](m.time), 0), "more")
    text = to_toml(m)
    assert "[[spline]]" in text and "[[table]]" in text and "smooth_step(" in text and "profile(s, 2)" in text
    again = model_of(text, Path("slider.toml"))
    assert to_toml(again) == text and digest(again) == digest(m) == digest(pickle.loads(pickle.dumps(m)))
    programs = ncgen.generate(m).programs.programs
    assert recall._restored(json.loads(json.dumps(recall._plain(programs)))) == programs
    other = slider()
    other.curves["law"](other.time)
    assert digest(other) != digest(m)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("profile(s, 4)", "profile: 4 is no order of a derivative here; give 0 to 3"),
        ("law(s, 2)", "law: 2 is no order of a derivative here; give 0 to 1"),
        ("profile()", "profile takes one expression, and the order of its derivative"),
        ("profile(s, k)", "profile takes one expression, and the order of its derivative"),
        ("profile(s, 1, 2)", "profile takes one expression, and the order of its derivative"),
        ("smooth_step(s, 1, 1)", "it starts and ends at 1"),
        ("smooth_step(s, 1, 2, 3)", "smooth_step takes one expression, and the order of its derivative or its start and end"),
        ("prof(s)", "prof of 1 is unknown; the functions are sqrt, .*, smooth_step, profile, law, rate$"),
        ("profile", "profile is no coordinate, parameter or t; define it first"),
        ("1/smooth_step(0)", "is not a finite number"),
    ],
)
def test_expressions_of_files(text, said):
    m = slider()
    with pytest.raises(ModelError, match=said):
        parse_expression(text, {"s", "k"}, m.curves)


def test_what_files_say():
    m = slider()
    s, profile = sympy.Symbol("s", real=True), m.curves["profile"]
    assert parse_expression("2*profile(s)**2 - profile(3*s, 1)", {"s"}, m.curves) == 2 * profile(s) ** 2 - profile(3 * s, 1)
    assert parse_expression("smooth_step(s, 1, 3)", {"s"}) == ncgen.smooth_step(s, 1, 3)
    assert parse_expression("profile(profile(s)) + law(2)", {"s"}, m.curves) == profile(profile(s)) - 1.0


REFUSED = {
    "a value too few": (lambda m: m.spline("c", (0, 1), (1,)), "spline c: 2 knots and 1 value given; give a value for every knot"),
    "equal knots": (lambda m: m.table("c", (0, 0, 1), (1, 2, 3)), "table c: the knot 0 follows 0; give knots that increase"),
    "a spline of too few": (lambda m: m.spline("c", (0, 1, 2), (1, 2, 1), "periodic"), "spline c: 3 knots given; give 4 to 10000"),
    "one knot": (lambda m: m.table("c", (0,), (1,)), "table c: 1 knot given; give 2 to 10000"),
    "ends that differ": (lambda m: m.table("c", (0, 1, 2), (1, 2, 3), True), "table c: it begins with 1 and ends with 3; what repeats"),
    "no end": (lambda m: m.spline("c", (0, 1), (1, 2), "soft"), "spline c: end 'soft' is unknown; choose one of natural, clamped, "),
    "steep": (lambda m: m.spline("c", (0, 1e-300, 1), (1, 2e90, 2)), "spline c: knots are so close, or values so large, that its"),
    "a parameter": (lambda m: m.spline("c", (0, m.parameters["k"]), (1, 2)), "spline c, knots, 2: parameter k depends on parameters"),
    "a name twice": (lambda m: m.spline("law", (0, 1), (1, 2)), "curve law: the name is already used for curve law; choose another"),
    "a length's name": (lambda m: m.spline("s", (0, 1), (1, 2)), "curve s: the name is already used for length s; choose another"),
    "a curve's name": (lambda m: m.parameter("law", 1.0), "parameter law: the name is already used for curve law; choose another"),
    "the step's name": (lambda m: m.table("smooth_step", (0, 1), (1, 2)), "curve smooth_step: every model has one of that name"),
    "no expression": (lambda m: m.curves["law"]("s"), "law: 's' is not an expression"),
    "no order": (lambda m: m.curves["law"](m.time, 0.5), "law: 0.5 is no order of a derivative here; give 0 to 1"),
    "a curve alone": (lambda m: m.torque("s", m.curves["law"]), "torque s, expression: curve law is not an expression"),
    "no step": (lambda m: ncgen.smooth_step(m.time, 1, 1.0), "smooth_step: it starts and ends at 1"),
    "another's": (lambda m: m.torque("s", wider().curves["law"](m.time)), "torque, expression: curve law belongs to another model"),
    "another's law": (lambda m: m.spring("O", "B", law=lambda x, v: wider().curves["law"](x)), "spring, law: curve law belongs to another"),
}


def wider() -> ncgen.Model:
    """A model with another curve of the same name."""
    m = ncgen.Model("wider")
    m.table("law", (0, 1), (0, 1))
    return m


@pytest.mark.parametrize("case", REFUSED)
def test_refusals(case):
    act, said = REFUSED[case]
    m = slider()
    before = len(m.curves), len(m.facts)
    with pytest.raises(ModelError) as told:
        act(m)
    assert said in str(told.value) and "\n" not in str(told.value) and (len(m.curves), len(m.facts)) == before


def test_a_function_of_files_is_no_name_there():
    m = slider()
    m.torque("s", m.spline("sin", (0, 1), (0, 1))(m.time))
    with pytest.raises(ModelError, match="curve sin: in the expressions of files that is the name of a function; choose another"):
        to_toml(m)


@pytest.mark.parametrize("modules", [None, "math", "numpy", "scipy", "mpmath", "sympy"])
def test_lambdify_takes_curves(modules):
    """What sympy makes of a law with curves computes what they are at a number, and arrays at once where the library has them."""
    m = ncgen.Model("m")
    lift, steps = m.spline("lift", (0, 0.5, 1.0), (0, 0.2, 0.1)), m.table("steps", (0, 0.4, 1), (1, 0, 2), periodic=False)
    t = m.time
    law = 2 * lift(t**2) * sympy.cos(t) + lift(t, 1) + steps(t) + ncgen.smooth_step(t, 0, 0.7)
    found = sympy.lambdify(t, law, modules)
    places = np.array([-0.2, 0.1, 0.35, 0.8, 1.3])
    expected = [float(law.subs(t, place)) for place in places]
    assert [float(found(place)) for place in places] == pytest.approx(expected, rel=1e-14)
    if modules in (None, "numpy", "scipy"):
        assert found(places) == pytest.approx(expected, rel=1e-14)
