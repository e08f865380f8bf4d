"""A formalism of the user's own, as an object: the same motion, and one line for what is wrong with it."""

from types import SimpleNamespace

import numpy as np
import pytest

import ncgen
from ncgen.report.along import Recorded
from ncgen.solver.formalisms.udwadia_phohomsiri import udwadia_phohomsiri

START = {"zd0": {"B.y": -3.0}}


def least_constraint(now):
    """Gauss' principle by Udwadia and Kalaba, Proc. R. Soc. A 439 (1992), for regular M."""
    root = np.linalg.cholesky(now.mass)
    free = np.linalg.solve(now.mass, now.force)
    rows = np.linalg.solve(root, now.jacobian.T).T
    return free + np.linalg.solve(root.T, np.linalg.lstsq(rows, now.gamma - now.jacobian @ free, rcond=None)[0])


def own(accelerations=least_constraint, name="gauss"):
    return SimpleNamespace(name=name, accelerations=accelerations)


@pytest.fixture(scope="module")
def pendulum():
    return ncgen.compile(ncgen.load("pendulum"))


def test_the_same_motion(pendulum):
    """Positions, accelerations and multipliers."""
    mine, lagrange = (ncgen.simulate(pendulum, 1.0, formalism=each, rtol=1e-11, **START) for each in (own(), "lagrange"))
    assert mine.formalism == "gauss" and mine.engine.startswith("python") and "gauss" in mine.made_with
    for name in ("q", "qd", "qdd", "lam", "work"):
        assert getattr(mine, name) == pytest.approx(getattr(lagrange, name), abs=1e-8), name


def test_redundant_constraints():
    """Two equal distances: the rows that are not in use get no multiplier, and the motion is that of one."""
    m = ncgen.Model("twice")
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    m.body("bob", [B], mass=2.0)
    m.distance(A, B)
    m.distance(B, A)
    m.gravity((0, -9.81))
    kernels = ncgen.compile(m)
    mine, lagrange = (ncgen.simulate(kernels, 0.5, formalism=each, rtol=1e-11) for each in (own(), "lagrange"))
    assert mine.q == pytest.approx(lagrange.q, abs=1e-8) and mine.qdd == pytest.approx(lagrange.qdd, abs=1e-7)


@pytest.mark.parametrize("name", ["fourbar", "andrews"])
def test_a_formalism_of_ncgens_as_an_object(name):
    """Udwadia and Phohomsiri's, with singular M: the same positions and work, step by step, and multipliers of smallest norm."""
    kernels = ncgen.compile(ncgen.load(name))
    mine = own(lambda now: udwadia_phohomsiri(now)[0], "mine")
    options = {"rtol": 1e-9, "engine": "python", "points": 5}
    one, other = (ncgen.simulate(kernels, 0.01, formalism=each, **options) for each in (mine, "udwadia-phohomsiri"))
    assert one.q == pytest.approx(other.q, abs=1e-12) and one.work == pytest.approx(other.work, abs=1e-12)
    assert one.lam == pytest.approx(other.lam, rel=1e-6, abs=1e-8)


@pytest.mark.filterwarnings("ignore:pendulum. idle without projection")
def test_its_accelerations_are_what_is_integrated(pendulum):
    """Where they are zero and nothing is projected, the point goes straight on."""
    idle = own(lambda now: np.zeros_like(now.force), "idle")
    with pytest.warns(UserWarning, match="idle holds the constraints to 0.0009 only"):
        run = ncgen.simulate(pendulum, 0.01, formalism=idle, options={"stabilisation": "none"}, **START)
    assert run.q[-1] == pytest.approx(run.q[0] + 0.01 * run.qd[0], abs=1e-12)
    assert run.qd[-1] == pytest.approx([0.0, -3.0], abs=1e-12)
    assert not np.any(run.qdd)


METHODS = [{"integrator": name} for name in ("dopri5", "rk23", "radau", "bdf", "adams", "lsoda")] + [
    {"integrator": "rk4", "max_step": 1e-3}
]


@pytest.mark.parametrize("method", METHODS)
def test_integrators_of_python(pendulum, method):
    lagrange = ncgen.simulate(pendulum, 0.1, rtol=1e-11, **START)
    assert ncgen.simulate(pendulum, 0.1, formalism=own(), rtol=1e-9, **method, **START).q == pytest.approx(lagrange.q, abs=1e-7)


class Gauss:
    name = "gauss"

    def accelerations(self, now):
        return least_constraint(now)


@pytest.mark.parametrize(
    "given, words",
    [
        (dict(formalism=Gauss), "formalism: Gauss is a class; give an object of it, such as Gauss()"),
        (dict(formalism=least_constraint), "has no function accelerations; give an object with one and a name"),
        (dict(formalism=SimpleNamespace(name="x")), "formalism: namespace(name='x') has no function accelerations"),
        (dict(formalism=own(name=None)), "formalism: the name of the object is None; it must be a text of one line"),
        (dict(formalism=own(name="two\nlines")), "formalism: the name of the object is 'two\\nlines'; it must be a text of one line"),
        (dict(formalism=own(name="lagrange")), "formalism: the name of the object is 'lagrange', which ncgen has, too"),
        (dict(formalism=own(lambda now: None)), "formalism 'gauss': accelerations returned None; return 2 numbers, one a coordinate"),
        (dict(formalism=own(lambda now: [1.0])), "formalism 'gauss': accelerations returned [1.0]; return 2 numbers"),
        (dict(formalism=own(lambda now: 1j * now.force)), "formalism 'gauss': accelerations returned "),
        (dict(formalism=own(), engine="c"), "pendulum cannot be simulated in C: gauss runs in Python"),
        (dict(formalism=own(), engine="emitted"), "engine 'emitted': a state derivative is emitted for coordinate-partitioning, not"),
        (dict(formalism=own(), number="float"), "pendulum cannot be simulated in C with float: gauss runs in Python"),
        (dict(formalism=own(), integrator="trapezoidal", max_step=1e-3), "trapezoidal does not go with gauss"),
        (dict(formalism=own(), integrator="rattle", max_step=1e-3), "rattle does not go with gauss"),
        (dict(formalism=own(), options={"alpha": 1.0}), "option alpha: gauss with dopri5 has no such option"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(pendulum, given, words):
    with pytest.raises(ncgen.ModelError) as raised:
        ncgen.simulate(pendulum, 0.1, **given)
    assert words in str(raised.value) and "\n" not in str(raised.value)


def test_other_functions_refuse_it(pendulum):
    rows = np.tile(pendulum.q0, (2, 1))
    for call in (lambda: ncgen.simulate(pendulum, 0.1, q0=rows, formalism=own()), lambda: ncgen.start(pendulum, formalism=own())):
        with pytest.raises(ncgen.ModelError, match="formalism is given, and it has no effect (here|with rows of states)"):
            call()
    with pytest.raises(ncgen.ModelError, match="formalism: an object is no data"):
        ncgen.study(ncgen.load("pendulum"), {"g": [1.0]}, duration=0.1, formalism=own(), keep="B.y")


def test_files_keep_the_numbers(pendulum, tmp_path):
    """What ncgen does not know it does not make a trajectory of."""
    run = ncgen.simulate(pendulum, 0.1, formalism=own(), **START)
    run.to_npz(tmp_path / "run.npz")
    recorded = Recorded.read(tmp_path / "run.npz")
    assert np.array_equal(recorded.arrays["qdd"], run.qdd) and recorded.health(pendulum) is not None
    with pytest.raises(ncgen.NcgenError, match="is not what this ncgen knows: 'gauss'"):
        recorded.trajectory(pendulum)


def test_exceptions_arrive_unchanged(pendulum):
    error = KeyError("mine")

    def fails(now):
        raise error

    with pytest.raises(KeyError) as raised:
        ncgen.simulate(pendulum, 0.1, formalism=own(fails))
    assert raised.value is error


def test_not_finite_has_its_time(pendulum):
    with pytest.raises(ncgen.SingularError, match="pendulum: formalism 'gauss' returned accelerations that are not finite"):
        ncgen.simulate(pendulum, 0.1, formalism=own(lambda now: now.force * np.nan))


def test_matrices_are_not_changed(pendulum):
    """The multipliers are found with them."""

    def changes(now):
        now.mass[:] = 0.0

    with pytest.raises(ValueError, match="read-only"):
        ncgen.simulate(pendulum, 0.1, formalism=own(changes))
