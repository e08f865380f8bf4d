"""Bodies that slide in the tree: beside what they share with others, held components and rows say along which direction."""

import numpy as np

import ncgen
from ncgen import Model, load
from ncgen.symbolic.tree import spanning_tree


def drawer() -> Model:
    """A box that slides in an arm, with which it shares two vectors, 0.3 m beside the arm's hinge."""
    m = Model("drawer")
    O, z = m.point("O", (0, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    u, w = m.vector("u", (1, 0, 0)), m.vector("w", (0, 1, 0))
    A, P = m.point("A", (0.2, 0.3, 0.0)), m.point("P", (0.7, 0.3, 0.0))
    arm = m.body("arm", [O, A], [z, u, w], mass=2.0, com=(0.1, 0.2, 0.0), inertia=(0.1, 0.2, 0.3))
    box = m.body("box", [P], [u, w], mass=1.5, com=(0.7, 0.3, 0.1), inertia=(0.01, 0.02, 0.025))
    m.prismatic(arm, box, A, P, u)
    m.angle("turn", m.vector("x", (1, 0, 0), fixed=True), u, z)
    m.slide("out", A, P, u)
    return m


def test_a_slider_that_shares_two_vectors_has_one_freedom():
    """M of a hinge and a slider that goes by it at 0.3 m: with c = (0.7 + s, 0.3) for the box's centre of mass and s = out − 0.5."""
    assert [len(link.screws) for link in spanning_tree(drawer()).links] == [1, 1]
    space = ncgen.joint_space(ncgen.compile(drawer(), "numpy"))
    assert space.rates == ("turn", "out")
    for turn, out in ((0.0, 0.5), (0.8, 0.9), (-2.0, 0.1)):
        q = space.position({"turn": turn, "out": out})
        x = 0.2 + out
        about = 0.3 + 2.0 * (0.1**2 + 0.2**2) + 0.025 + 1.5 * (x**2 + 0.3**2)
        np.testing.assert_allclose(space.mass_matrix(q), [[about, -1.5 * 0.3], [-1.5 * 0.3, 1.5]], rtol=0, atol=1e-13)
        # the slider alone is pulled outward by the turn: Coriolis' force −m x ω² along it, 2 m x ω ṡ about the hinge
        np.testing.assert_allclose(space.coriolis(q, [2.0, 0.7]), [2 * 1.5 * x * 2.0 * 0.7, -1.5 * x * 4.0], rtol=0, atol=1e-12)


def test_held_components_guide_a_body():
    """A cart of two points with a held height slides and does not turn; a slider with a held y and a fixed vector has one freedom."""
    assert [len(link.screws) for link in spanning_tree(load("cartpole")).links] == [1, 1]
    slider = next(link for link in spanning_tree(load("slidercrank3d")).links if link.body.name == "slider")
    assert len(slider.screws) == 1


def test_a_guided_body_may_still_turn():
    """A bar in the plane whose end goes along x: a slide and a turn, and the equations of an elliptic trammel without its other guide."""
    m = Model("guided")
    A, B = m.point("A", (0.0, 0.0), fixed="y"), m.point("B", (0.6, -0.8))
    m.body("bar", [A, B], mass=3.0, com=(0.3, -0.4), inertia=0.25)
    m.gravity((0, -9.81, 0))
    (link,) = spanning_tree(m).links
    assert [screw.point is None for screw in link.screws] == [True, False]
    space = ncgen.joint_space(ncgen.compile(m, "numpy"))
    q = space.kernels.q0
    np.testing.assert_allclose(space.mass_matrix(q), [[3.0, 3.0 * 0.4], [3.0 * 0.4, 0.25 + 3.0 * 0.25]], rtol=0, atol=1e-13)
    np.testing.assert_allclose(space.gravity(q), [0.0, 3.0 * 9.81 * 0.3], rtol=0, atol=1e-12)
