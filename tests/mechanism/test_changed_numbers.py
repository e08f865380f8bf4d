"""A model with other numbers than one that was compiled compiles nothing, and moves as if it had been compiled by itself."""

import operator
import os
import pickle
import random
import subprocess
import sys
import sysconfig
import xml.etree.ElementTree as xml
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ncgen
from ncgen.comparisons.changed_robot import changed_copy
from ncgen.mechanism import constrained_dynamics, motion_check, numbered
from ncgen.model.elements import Angle
from ncgen.model.traced_numbers import Trace, computed
from ncgen.program.differentiation import tangent_programs
from ncgen.program.ir.functions import FUNCTIONS
from ncgen.solver.positions import rank
from ncgen.symbolic.traced_model import described, traced
from ncgen.symbolic.tree import spanning_tree

ROBOTS = Path(sysconfig.get_paths()["purelib"], "cmeel.prefix/share/example-robot-data/robots")


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache of the test's own."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(folder))
    return folder


def libraries(cache):
    """Names of the libraries of mechanisms in a cache: the runtime has parts that a run may ask for at any time."""
    return {record.parent.name for record in cache.glob("*/build.json") if not (record.parent / "ncgen_vectors.c").exists()}


def arm(lengths=(0.7, 0.45, 0.3), masses=(2.1, 1.3, 0.4)):
    """Hinges about y, z and y in a row, without angles."""
    m = ncgen.Model("arm3")
    axis, base, x = m.vector("u0", (0, 1, 0), fixed=True), m.point("A0", (0, 0, 0), fixed=True), 0.0
    for k, (length, mass) in enumerate(zip(lengths, masses, strict=True), 1):
        x += length
        end, following = m.point(f"A{k}", (x, 0, 0)), m.vector(f"u{k}", ((0, 1, 0), (0, 0, 1))[k % 2])
        inertia = (0.012 + 0.01 * mass, 0.03, 0.02)
        m.body(f"link{k}", points=[base, end], vectors=[axis, following], mass=mass, com=(x - 0.37 * length, 0, 0), inertia=inertia)
        base, axis = end, following
    m.gravity((0, 0, -9.81))
    return m


def four_bar(a=1.0, b=1.3, c=0.8, d=1.7):
    """Cranks a and c on bearings that are d apart, and a coupler b; where b = d and a = c it is a parallelogram."""
    m = ncgen.Model("fourbar4")
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    origin, bearing = m.point("O", (0, 0), fixed=True), m.point("D", (d, 0), fixed=True)
    psi = 1.1
    pin = a * np.array([np.cos(psi), np.sin(psi)])
    across = np.array([d, 0.0]) - pin
    far = np.linalg.norm(across)
    turn = np.arctan2(across[1], across[0]) + np.arccos((b**2 + far**2 - c**2) / (2 * b * far))
    A, B = m.point("A", pin), m.point("B", pin + b * np.array([np.cos(turn), np.sin(turn)]))
    for name, ends, mass in (("crank", (origin, A), 1.1), ("coupler", (A, B), 2.3), ("rocker", (B, bearing), 1.9)):
        m.body(name, list(ends), mass=mass, inertia="rod")
    m.angle("psi", x, A - origin, z)
    m.gravity((0, -9.81))
    return m


def moved(model, **arguments):
    return ncgen.simulate(ncgen.compile(model, "c"), 0.2, rtol=1e-10, **arguments)


def agree(model, cache, monkeypatch, tmp_path):
    """The motion of a model beside that of the matrix, which nothing was left out of, in a cache of its own."""
    run = moved(model)
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path / "another"))
    matrix = moved(model, engine="c")
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(cache))
    np.testing.assert_allclose(run.q[-1], matrix.q[-1], rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(run.qd[-1], matrix.qd[-1], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("first", "other"),
    [
        (arm(), arm(lengths=(0.71, 0.45, 0.3))),
        (arm(), arm(masses=(2.1, 1.35, 0.41))),
        (four_bar(), four_bar(b=1.31)),
        (four_bar(), four_bar(d=1.6, c=0.9)),
    ],
    ids=["length", "mass", "loop", "two lengths"],
)
def test_other_numbers_compile_nothing(cache, monkeypatch, tmp_path, first, other):
    moved(first)
    before = libraries(cache)
    moved(other)
    assert libraries(cache) == before
    agree(other, cache, monkeypatch, tmp_path)


@pytest.mark.parametrize(
    ("first", "other"),
    [
        (four_bar(0.9, 1.7, 0.9, 1.7), four_bar(0.9, 1.7, 0.95, 1.7)),
        (arm(), arm(lengths=(1.0, 0.45, 0.3))),
        (arm(lengths=(0.7, 0.3, 0.3)), arm(lengths=(0.7, 0.45, 0.3))),
    ],
    ids=["parallelogram", "one", "equal lengths"],
)
def test_coincidences_do_not_stay(cache, monkeypatch, tmp_path, first, other):
    """What vanishes for the first numbers only is there for the others."""
    moved(first)
    agree(other, cache, monkeypatch, tmp_path)


def test_linear_equations_of_other_numbers_derive_nothing(cache, monkeypatch, tmp_path):
    """To the last bit those of a mechanism that was derived by itself."""
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path / "another"))
    alone = state_matrix(four_bar(b=1.31))
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(cache))
    first = state_matrix(four_bar())

    def again(*_):
        raise AssertionError("derived again")

    monkeypatch.setattr(tangent_programs, "assemble_tangents", again)
    matrix = state_matrix(four_bar(b=1.31))
    assert np.array_equal(matrix, alone) and not np.allclose(matrix, first, rtol=1e-3)


def state_matrix(model):
    """Of small motions about the fall from the start."""
    with pytest.warns(UserWarning, match="neither rest in equilibrium"):
        return ncgen.linearise(ncgen.compile(model, "c")).A


def test_what_the_structure_tells_is_not_found_again(cache, monkeypatch):
    """Of a large tree: how the matrix is factored; nor are rows that others imply looked for, since its joints tell the rank."""
    moved(arm([0.3] * 24, [1.3] * 24))

    def again(*_):
        raise AssertionError("found again")

    monkeypatch.setattr(constrained_dynamics, "plan", again)
    monkeypatch.setattr(rank, "freedom_at", again)
    moved(arm([0.3] * 24, [1.3] * 23 + [1.4]))


def test_a_motion_that_does_not_suit_is_not_used(cache, monkeypatch, tmp_path):
    """With numbers that are not those of the kernels it is refused, and generated for them alone."""
    moved(arm())
    recall, refused = numbered.Structured.recall, []

    def wrong(structure, kind, only_exact=False):
        entry = recall(structure, kind, only_exact)
        if entry is None or kind != "motion" or only_exact:
            return entry
        return entry._replace(sources=entry.sources._replace(values=[1.001 * value for value in entry.sources.values]))

    agrees = motion_check._Check.agrees
    monkeypatch.setattr(numbered.Structured, "recall", wrong)
    monkeypatch.setattr(motion_check._Check, "agrees", lambda check: refused.append(not agrees(check)) or not refused[-1])
    agree(arm(masses=(2.2, 1.3, 0.4)), cache, monkeypatch, tmp_path)
    assert refused == [True]


def test_numbers_whose_products_are_none():
    """What is too large is refused by the name of the body, as in any other model."""
    m = ncgen.Model("spread")
    ends = [m.point(name, position) for name, position in (("A", (1e-6, 0, 0)), ("B", (0, 1e-6, 0)), ("C", (0, 0, 1e-6)), ("D", (0, 0, 0)))]
    m.body("plate", points=ends, mass=1e100, com=(1e100, 1e100, 1e100), inertia=(1.0, 1.0, 1.0))
    with pytest.raises(ncgen.ModelError, match="exceeds"):
        ncgen.compile(m, "c")


def test_models_of_one_structure_live_side_by_side(cache):
    heavy, light = ncgen.compile(arm(masses=(3.1, 1.3, 0.4)), "c"), ncgen.compile(arm(masses=(2.1, 1.3, 0.4)), "c")
    assert len(libraries(cache)) == 1
    q = heavy.q0
    for kernels, mass in ((heavy, 3.1), (light, 2.1)):
        assert kernels.mass_matrix(q).sum() == pytest.approx(ncgen.compile(arm(masses=(mass, 1.3, 0.4)), "numpy").mass_matrix(q).sum())
    assert heavy.fingerprint != light.fingerprint
    again = pickle.loads(pickle.dumps(light))
    assert np.array_equal(again.mass_matrix(q), light.mass_matrix(q)) and again.fingerprint == light.fingerprint
    first, second = (ncgen.simulate(kernels, 0.1) for kernels in (heavy, light))
    assert not np.allclose(first.q[-1], second.q[-1]) and np.array_equal(ncgen.simulate(heavy, 0.1).q, first.q)


def test_results_do_not_depend_on_what_was_compiled_before(cache, monkeypatch, tmp_path):
    """To the last bit, in processes of their own."""
    script = "import sys; sys.path.insert(0, sys.argv[1]); import test_changed_numbers as t; print(t.moved(t.arm()).q[-1].tolist())"
    here = str(Path(__file__).parent), str(Path(__file__).parents[1])

    def result():
        path = {"PYTHONPATH": ":".join([*here, str(Path(__file__).parents[2])])}
        return subprocess.run(
            [sys.executable, "-c", script, here[0]], capture_output=True, text=True, check=True, env=os.environ | path
        ).stdout

    alone = result()
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path / "another"))
    moved(arm(masses=(2.2, 1.3, 0.4)))
    assert result() == alone


@given(st.lists(st.sampled_from(["add", "sub", "mul", "truediv", "neg", "abs"]), max_size=12), st.integers(0, 2**32))
@settings(deadline=None, max_examples=60)
def test_traced_numbers_are_what_they_were_computed_from(codes, seed):
    """Each number equals the same operations on other numbers, unless a comparison has another outcome."""
    draw = random.Random(seed)

    def work(numbers):
        chance, values = random.Random(seed + 1), list(numbers)
        for code in codes:
            a, b = chance.choice(values), chance.choice(values)
            if code in ("neg", "abs"):
                values.append(getattr(operator, code)(a))
            elif code != "truediv" or b != 0.0:
                values.append(getattr(operator, code)(a, b))
            if a > b:
                values.append(2.0)
        return values

    first, other = ([draw.uniform(-2, 2) for _ in range(3)] for _ in range(2))
    trace = Trace()
    traced = work([trace.given(value, k) for k, value in enumerate(first)])
    assert list(map(float, traced)) == work(first)
    operations = [trace.operation(value) for value in traced]
    functions = {name: function.python for name, function in FUNCTIONS.items()}
    values = computed(trace.operations, trace.comparisons, other, functions)
    if values is not None:
        assert [values[k] for k in operations] == work(other)


def skew_robot(folder, length):
    """A finger of four skew hinges on a table, the second one so long, beside a leg whose hip is on the first one's axis."""
    links = [("table", "1"), ("hip", "2"), ("one", "0.3"), ("two", "0.2"), ("three", "0.04"), ("four", "0.01")]
    joints = [("table", "one", "0.4 0.2 0"), ("one", "two", f"{length!r} 0.013 -0.21"), ("two", "three", "0.011 0.017 -0.023"),
              ("three", "four", "0.007 -0.019 0.011"), ("table", "hip", f"{0.4 + length - 0.35!r} -0.2 0")]  # fmt: skip
    inertia = '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.021" iyz="0.001" izz="0.022"/>'
    text = "".join(
        f'<link name="{name}"><inertial><origin xyz="0.01 0.02 -0.03"/><mass value="{mass}"/>{inertia}</inertial></link>'
        for name, mass in links
    ) + "".join(
        f'<joint name="{child}_hinge" type="continuous"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/></joint>'
        for (parent, child, xyz), axis, rpy in zip(
            joints,
            ("0 1 0", "0.6 0 0.8", "1 0 0", "0 1 0", "0 1 0"),
            ("0 0 0", "0.3 -0.7 1.1", "0.1 0.9 -0.4", "0.7 0.2 0.1", "0 0 0"),
            strict=True,
        )
    )
    path = folder / "skew.urdf"
    path.write_text(f'<robot name="skew">{text}</robot>', encoding="utf-8")
    return ncgen.load(path)


@pytest.mark.parametrize("name", ["fourbar", "robot", "slidercrank3d", "quadruped"])
def test_a_model_that_has_travelled_has_the_same_structure(name):
    """Told with a copy and without one."""
    model = ncgen.load(name)
    twin = pickle.loads(pickle.dumps(model))
    copied = traced(twin)
    assert described(model).identity() == described(twin).identity() != described(ncgen.load("cam")).identity()
    told = described(model).told_apart()
    assert told == described(twin).told_apart() == (copied.digest, copied.numbers, spanning_tree(model).dof)


def test_rounding_of_a_length_is_no_structure(tmp_path):
    """Angles and cosines that are zero but for rounding stay that for other lengths, as do hips on one axis of what rests."""
    first = skew_robot(tmp_path, 0.35)
    digests = {traced(skew_robot(tmp_path, 0.35 * factor)).digest for factor in np.random.default_rng(4).uniform(0.9, 1.1, 30).tolist()}
    assert digests == {traced(first).digest}
    angles = [element for element in first.elements.values() if isinstance(element, Angle)]
    assert len(angles) == 5 and all(component.initial == 0.0 for angle in angles for component in angle.components)


ROBOT_FILES = sorted(path for path in ROBOTS.rglob("*.urdf")) if ROBOTS.is_dir() else []


@pytest.mark.slow
@pytest.mark.skipif(not ROBOTS.is_dir(), reason="needs example-robot-data")
@pytest.mark.parametrize("quantity", ["mass", "length"])
@pytest.mark.parametrize("path", ROBOT_FILES, ids=lambda path: path.stem)
def test_a_changed_robot_file_compiles_nothing(cache, monkeypatch, tmp_path, path, quantity):
    """One mass of the file, or the length in its middle, changed by a percent."""
    try:
        moved_robot(ncgen.load(path))
    except ncgen.NcgenError as refusal:
        pytest.skip(str(refusal))
    changed, before = (changed_copy if quantity == "mass" else with_changed_length)(path, tmp_path), libraries(cache)
    if changed is None:
        pytest.skip("no joint is away from its parent")
    run = moved_robot(ncgen.load(changed))
    assert libraries(cache) == before
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path / "another"))
    alone = moved_robot(ncgen.load(changed))
    np.testing.assert_allclose(run.q[-1], alone.q[-1], rtol=1e-9, atol=1e-9)


def with_changed_length(path, folder):
    """A copy of a file whose middle joint is a percent farther from its parent along an axis, or the next one that leaves axes meeting;
    None where it has no lengths. One that is in the file twice may be a symmetry, as that of two fingers, without which products of inertia
    appear: those that are there once come first.
    """
    tree, elements = xml.parse(path), ncgen.load(path).elements.keys()
    origins = [joint.find("origin") for joint in tree.getroot().iter("joint") if joint.find("origin") is not None]
    lengths = [(origin, k) for origin in origins for k, x in enumerate(origin.get("xyz", "").split()) if abs(float(x)) > 1e-6]
    if not lengths:
        return None
    sizes = [abs(float(origin.get("xyz").split()[k])) for origin, k in lengths]
    lengths = [place for place, size in zip(lengths, sizes, strict=True) if sizes.count(size) == 1] or lengths
    for origin, k in lengths[len(lengths) // 2 :]:
        before = origin.get("xyz")
        words = before.split()
        words[k] = repr(1.01 * float(words[k]))
        origin.set("xyz", " ".join(words))
        tree.write(folder / path.name)
        if ncgen.load(folder / path.name).elements.keys() == elements:
            break
        origin.set("xyz", before)
    return folder / path.name


def moved_robot(model):
    return ncgen.simulate(ncgen.compile(model, "c"), 0.01, rtol=1e-8)
