"""Welds to the ground and between links in every order, points that coincide but for rounding, and robots of any size."""

import itertools

import numpy as np
import pytest

import ncgen
from ncgen.errors import ModelError

GAPS = (0.0, 1e-16, 1e-9, 1e-6, 1e-3, 0.1)


def block(m, name, place, generator, elements=True):
    """A body of a point, a second one and two unit vectors."""
    frame = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    points = [m.point(f"{name}1", place), m.point(f"{name}2", place + frame[0])]
    vectors = [m.vector(f"{name}u", frame[1]), m.vector(f"{name}v", frame[2])]
    return m.body(name, points, vectors if elements else vectors[:1], mass=1.0, inertia=(0.3, 0.4, 0.5))


@pytest.mark.parametrize("is_first", [True, False])
def test_a_body_welded_to_the_ground_rests_with_all_that_it_gets_later(is_first):
    m = ncgen.Model("rests")
    body = block(m, "b", np.array([0.3, 0.1, -0.2]), np.random.default_rng(1))
    m.rigid(*((m.ground, body) if is_first else (body, m.ground)))
    late = m.attach_point(body, "late", (1.0, 2.0, 3.0))
    free = block(m, "c", np.array([1.0, 2.0, 3.0]), np.random.default_rng(2))
    m.spherical(body, free, late)
    found = ncgen.freedom(ncgen.compile(m, "numpy"))
    assert (found.dof, len(found.redundant)) == (3, 0)


def test_a_weld_of_a_body_that_shows_its_directions_later():
    m = ncgen.Model("bar")
    a, b = m.point("a", (0, 0, 0)), m.point("b", (1, 0, 0))
    bar = m.body("bar", [a, b])
    m.rigid(bar, m.ground)
    c = m.attach_point(bar, "c", (0.2, 0.7, 0.1))
    m.body("load", [c], mass=1.0)
    assert ncgen.freedom(ncgen.compile(m, "numpy")).dof == 0


def test_a_flat_body_welded_to_the_ground():
    m = ncgen.Model("flat")
    body = m.body("plate", [m.point("a", (0.1, 0.2)), m.point("b", (1.0, 0.5))], mass=1.0, inertia=0.1)
    m.rigid(m.ground, body)
    found = ncgen.freedom(ncgen.compile(m, "numpy"))
    assert (found.dof, len(found.redundant)) == (0, 0)


def test_a_weld_that_would_hold_nothing_is_refused():
    m = ncgen.Model("own")
    body = m.body("own", [m.point("a", (0, 0, 0)), m.point("b", (1, 0, 0))], rigid=False)
    with pytest.raises(ModelError, match="body own has constraints of its own"):
        m.rigid(body, m.ground)


@pytest.mark.parametrize(("gap", "is_turned"), list(itertools.product(GAPS, (False, True))))
def test_welded_bodies_whose_points_almost_coincide_are_one(gap, is_turned):
    generator = np.random.default_rng(3)
    m = ncgen.Model("pair")
    first = block(m, "a", np.zeros(3), generator)
    second = block(m, "b", gap * np.array([0.6, 0.0, 0.8]), generator)
    m.rigid(*((second, first) if is_turned else (first, second)))
    m.gravity((0.0, 0.0, -9.81))
    kernels = ncgen.compile(m, "numpy")
    assert ncgen.freedom(kernels).dof == 6
    run = ncgen.simulate(kernels, 0.1, points=2)
    np.testing.assert_allclose(run["b2.z"][-1] - run["b2.z"][0], -9.81 * 0.1**2 / 2, atol=1e-9)


@pytest.mark.parametrize("gap", GAPS)
def test_a_slider_that_begins_almost_at_its_start(gap):
    """One slider and six degrees of freedom of its rail: rows are not divided by the gap."""
    m = ncgen.Model("slider")
    rail = block(m, "rail", np.zeros(3), np.random.default_rng(4))
    cart = block(m, "cart", gap * rail.vectors[0].initial, np.random.default_rng(5))
    m.prismatic(rail, cart, rail.points[0], cart.points[0], rail.vectors[0])
    m.slide("s", rail.points[0], cart.points[0], rail.vectors[0])
    kernels = ncgen.compile(m, "numpy")
    assert ncgen.freedom(kernels).dof == 7
    largest = max(np.abs(kernels.phi_q(kernels.q0).toarray()).max(axis=1))
    assert largest < 10.0


# -- files ---------------------------------------------------------------------------------------


def chain(size=1.0, gap=0.0):
    """Three bars on parallel hinges, metres times `size`; two links of each end stand `gap` from each other."""
    s = size
    inertia = f'<mass value="1"/><inertia ixx="{0.01 * s**2!r}" iyy="{0.1 * s**2!r}" izz="{0.1 * s**2!r}"/>'
    text = '<robot name="chain"><link name="base"/>'
    for name in "abc":
        text += f'<link name="{name}"><inertial><origin xyz="{0.5 * s!r} 0 0"/>{inertia}</inertial></link>'
    for name, parent, child, x in (("j1", "base", "a", 0.0), ("j2", "a", "b", s), ("j3", "b", "c", s)):
        text += f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        text += f'<origin xyz="{x!r} 0 {gap!r}" rpy="0 {-0.4 if name == "j2" else 0.0} 0"/><axis xyz="0 1 0"/></joint>'
    return text + "</robot>"


def load(tmp_path, urdf, table=None, **options):
    path, loops = tmp_path / "chain.urdf", tmp_path / "loops.toml"
    path.write_text(urdf)
    if table is None:
        return ncgen.load(path, **options)
    loops.write_text(table)
    return ncgen.load(path, loops=loops, **options)


@pytest.mark.parametrize(("ends", "floating"), list(itertools.product([("base", "c"), ("c", "base")], [False, True])))
def test_a_table_welds_a_chain_to_its_base(tmp_path, ends, floating):
    table = f'[[weld]]\nparent = "{ends[0]}"\nchild = "{ends[1]}"\n'
    kernels = ncgen.compile(load(tmp_path, chain(), table, floating=floating), "numpy")
    assert ncgen.freedom(kernels).dof == (6 if floating else 0)


def test_a_loop_that_changes_nothing_is_refused_by_its_name(tmp_path):
    fixed = '<link name="d"/><joint name="f" type="fixed"><parent link="c"/><child link="d"/></joint></robot>'
    urdf = chain().replace("</robot>", fixed)
    weld = '[[weld]]\nname = "{0}"\nparent = "{1}"\nchild = "{2}"\n'
    with pytest.raises(ModelError, match="weld 1: joint twice changes nothing: links c and d are fixed to each other; leave it out"):
        load(tmp_path, urdf, weld.format("twice", "c", "d"))
    ball = '[[connect]]\nname = "{0}"\nparent = "base"\nchild = "c"\npoint = [1.0, 0.0, 0.0]\n'
    with pytest.raises(ModelError, match="connect 2: joint again changes nothing: its links share"):
        load(tmp_path, urdf, ball.format("once") + ball.format("again"))


def test_a_robot_of_a_micrometre_moves_like_one_of_a_metre(tmp_path):
    """Lengths times s with gravity times s: the angles are the same at every time."""
    runs = []
    for each in (1.0, 1e-6):
        model = load(tmp_path, chain(each))
        model.gravity((0.0, 0.0, -9.81 * each))
        run = ncgen.simulate(ncgen.compile(model, "c"), 0.3, rtol=1e-10, atol=1e-10 * min(each, 1.0), points=4)
        runs.append(np.array([run[name] for name in ("j1", "j2", "j3")]))
    np.testing.assert_allclose(runs[1], runs[0], rtol=0, atol=1e-8)
