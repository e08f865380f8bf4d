"""Many states in one call: each has the numbers that it has alone.

With fused multiply-adds the compiler may fuse differently for vectors. Without them, the comparison is exact.
"""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import ncgen
from ncgen.errors import NcgenError
from ncgen.mechanism.kernel_batch import LANES, CompiledBatch, available
from ncgen.mechanism.library import CompiledKernels
from ncgen.toolchain.cache import build
from ncgen.toolchain.compilers import FLAGS, find_compiler

COUNT = 21
"""No multiple of the lanes, so that the last block is not full."""


def unfused(flags):
    """gcc 12 fuses where it vectorises straight-line code, whatever -ffp-contract says, so it must not do that either."""
    return (*flags, "-ffp-contract=off", "-fno-tree-slp-vectorize")


ALWAYS, NEVER = 0.0, np.inf
"""Operations per number from which lanes are used."""


def exactly(sources, least=ALWAYS) -> CompiledKernels:
    """Kernels and their batch compiled without fused multiply-adds."""
    kernels = CompiledKernels(sources.programs, build(sources.c, find_compiler(), unfused(FLAGS)).library)
    kernels.__dict__["batch"] = CompiledBatch(kernels, unfused(LANES), least)
    return kernels


def states(kernels, count=COUNT):
    rng = np.random.default_rng(11)
    q = kernels.q0 + rng.uniform(-0.1, 0.1, (count, kernels.n))
    return q, rng.uniform(-1, 1, q.shape), rng.uniform(0, 1, count)


def assert_as_alone(kernels, q, qd, t, p):
    """Every kernel of every state equals the call with this state alone, to the last bit."""
    for name in kernels.programs.programs:
        together = kernels.batch.values(name, t, q, qd, p)
        for i in range(len(q)):
            time = t if np.ndim(t) == 0 else t[i]
            alone = kernels.values(name, time, q[i], qd[i], p if p is None or np.ndim(p) == 1 else p[i])
            assert np.array_equal(together[i], alone), (name, i)


@pytest.fixture(scope="module", params=[ALWAYS, NEVER], ids=["lanes", "in turn"])
def everything(request):
    """Every elementary function, a driver, parameters, a damper, in a mechanism that need not make sense."""
    m = ncgen.Model("everything")
    k, w = m.parameter("k", 1.5), m.parameter("w", 2.0)
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (0.6, 0.3))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("rod", [A, B], mass=0.5, inertia=1e-3)
    m.drive(m.angle("psi", x, B - A, z), w * m.time + 0.2 * sympy.sin(5 * m.time))
    u, v = k.symbol * B.x.symbol, B.y.symbol
    one = [sympy.sqrt, sympy.tan, sympy.asin, sympy.acos, sympy.atan, sympy.sinh, sympy.cosh, sympy.tanh, sympy.exp, sympy.log, sympy.Abs]
    m.constrain(sum((f(u / 2) for f in one), sympy.atan2(u, v) + sympy.sign(v) * u + u**v))
    m.gravity((0, -9.81, 0))
    return exactly(ncgen.generate(m), request.param)


@pytest.mark.parametrize("emission", ["auto", "tabled"])
def test_robot_states_as_alone(robot_model, emission):
    """Straight-line code and loops, whose constants come from tables and are the same in all lanes."""
    kernels = exactly(ncgen.generate(robot_model, emission))
    q, qd, _ = states(kernels)
    assert_as_alone(kernels, q, qd, 0.0, None)


@pytest.mark.parametrize("threads", [1, 2])
def test_every_function_time_and_parameters(everything, threads):
    """Own times and own parameters for each state, whatever the number of threads."""
    q, qd, t = states(everything)
    everything.batch.threads = threads
    assert_as_alone(everything, q, qd, t, np.linspace(1, 2, 2 * COUNT).reshape(COUNT, 2))
    assert_as_alone(everything, q, qd, 0.25, np.array([1.2, 1.7]))


def test_any_number_of_states(everything):
    """Blocks that are full, that lack one and that hold only one."""
    alone = everything.batch.values("phi", 0.0, *states(everything, 34)[:2], None)
    for count in range(1, 35):
        q, qd, _ = states(everything, 34)
        assert np.array_equal(everything.batch.values("phi", 0.0, q[:count], qd[:count], None), alone[:count])


def test_far_angles_as_alone(everything):
    """An angle far beyond the range of the polynomials, in one lane only."""
    q, qd, t = states(everything)
    q[3, everything.index["psi"]] = 1e9
    assert_as_alone(everything, q, qd, t, None)


def test_functions_of_constants():
    """The disc's rows have angles of fixed directions: functions whose arguments are in part the same for all lanes."""
    kernels = exactly(ncgen.generate(ncgen.load("disc")))
    q, qd, t = states(kernels)
    assert_as_alone(kernels, q, qd, t, None)


def test_what_computes_much_is_in_lanes(robot):
    """γ has seven operations for every number that it reads or writes, the mass matrix one."""
    assert robot.batch.in_lanes("gamma") and not robot.batch.in_lanes("mass")


def test_numpy_batches_alike(robot, robot_numpy):
    """The same states through NumPy: another program for the same kernels."""
    q, qd, _ = states(robot)
    for name in robot.programs.programs:
        c, numpy = (k.batch.values(name, 0.0, q, qd, None) for k in (robot, robot_numpy))
        assert c.shape == numpy.shape
        np.testing.assert_allclose(c, numpy, rtol=1e-12, atol=1e-13 * np.max(np.abs(numpy)))


def test_numpy_batches_have_their_own_times():
    """A force sin(t) x in NumPy, each state at a time of its own."""
    m = ncgen.Model("timed")
    P = m.point("P", (0, 0, 0))
    m.body("b", [P], mass=1.0)
    m.force(P, (sympy.sin(m.time) * P.x, 0, 0))
    kernels, t, q = ncgen.compile(m, "numpy"), np.linspace(0, 1, 7), np.ones((7, 3))
    np.testing.assert_allclose(kernels.batch.values("force", t, q, q, None)[:, 0], np.sin(t), rtol=1e-15)


def test_results_go_where_they_should(robot):
    """`out` is filled and returned; one of the wrong shape is refused."""
    q, _, _ = states(robot)
    out = np.full((COUNT, robot.m), 7.0)
    assert robot.batch.phi(q, out=out) is out
    assert np.array_equal(out, robot.batch.phi(q))
    with pytest.raises(NcgenError, match=r"robot\.batch\.phi: out must be a contiguous array of \(21, 31\) doubles"):
        robot.batch.phi(q, out=np.empty((COUNT, robot.m + 1)))
    for wrong in (np.empty((COUNT, robot.m), dtype=np.float32), np.empty((robot.m, COUNT)).T, np.broadcast_to(out[0], out.shape)):
        with pytest.raises(NcgenError, match="out must be a contiguous array"):
            robot.batch.phi(q, out=wrong)
    fixed = out.copy()
    fixed.flags.writeable = False
    with pytest.raises(NcgenError, match="that may be written to"):
        robot.batch.phi(q, out=fixed)
    with pytest.raises(NcgenError, match="out shares memory with an argument"):
        robot.batch.force(q, q, out=q)


@pytest.mark.parametrize(
    "given, said",
    [
        ({"q": np.zeros(36)}, r"q has shape \(36,\); one row for each state is needed, \(…, 36\)"),
        ({"q": np.zeros((4, 35))}, r"q has shape \(4, 35\); \(4, 36\) is needed"),
        ({"q": np.zeros((4, 36)), "qd": np.zeros((3, 36))}, r"qd has shape \(3, 36\)"),
        ({"q": np.zeros((4, 36)), "qd": np.zeros((4, 36)), "t": np.zeros(3)}, r"t has shape \(3,\); \(\) or \(4,\)"),
    ],
)
def test_wrong_shapes_are_named(robot, given, said):
    with pytest.raises(NcgenError, match=r"robot\.batch\.gamma: " + said) as caught:
        robot.batch.gamma(**({"qd": np.zeros((4, 36))} | given))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change, said",
    [
        (lambda q: 1j * q, "q is complex; real numbers are needed here, kernels of backend='numpy' take complex ones"),
        (lambda q: q.astype(str), r"q has a value that is not a number: array\(\[\["),
        (lambda q: [["a"] * 36] * 4, "q has a value that is not a number"),
        (lambda q: [[None] * 36] * 4, "q has a value that is not a number"),
        (lambda q: (q + 0j).astype(object), "q has a value that is not a number"),
        (lambda q: [*q[:-1].tolist(), [1.0]], "q has rows of different lengths; give an array"),
        (lambda q: np.ma.masked_less(q, np.max(q)), "q has masked numbers; fill them"),
    ],
)
@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_what_is_no_number_is_refused(robot, robot_numpy, backend, change, said):
    """In one sentence, the same for many states as for one."""
    kernels = robot if backend == "c" else robot_numpy
    given = change(states(robot, 4)[0])
    with pytest.raises(NcgenError, match=r"^robot\.batch\.phi: " + said) as many:
        kernels.batch.phi(given)
    assert "\n" not in str(many.value) and len(str(many.value)) <= 300
    if backend == "c" and "lengths" not in said and "array" not in said:
        with pytest.raises(NcgenError, match=r"^robot\.phi: " + said):
            kernels.phi(given[0])


@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_numbers_of_all_kinds_are_exact(robot, robot_numpy, backend):
    """Integers, single precision, objects, other byte orders, gaps between the numbers, masks without a mask."""
    kernels = robot if backend == "c" else robot_numpy
    whole = np.random.default_rng(5).integers(-3, 4, (COUNT, robot.n))
    expected = kernels.batch.phi(whole.astype(float))
    wide = np.zeros((2 * COUNT, 3 * robot.n))
    wide[::2, ::3] = whole
    given = [whole, whole.astype(np.float32), whole.astype(object), whole.astype(">f8"), whole.tolist(),
             np.asfortranarray(whole, dtype=float), wide[::2, ::3], np.ma.MaskedArray(whole.astype(float))]  # fmt: skip
    given += [whole.astype(np.longdouble)] if backend == "c" else []  # NumPy's kernels compute with them as they are
    for q in given:
        assert np.array_equal(kernels.batch.phi(q), expected)
        assert np.array_equal(kernels.phi(q[0]), kernels.phi(whole[0].astype(float)))


def test_a_time_that_is_no_number_is_refused(robot):
    for t in ("now", None, [0.0, 1.0], 1j):
        with pytest.raises(NcgenError, match=r"^robot\.phi: t is .*; compiled kernels take one real number"):
            robot.phi(robot.q0, t=t)
        with pytest.raises(NcgenError, match=r"^robot\.batch\.phi: t "):
            robot.batch.phi(robot.q0[None], t=t)


def test_threads_are_counted(robot):
    """No more are started than there are processors; what is no count is refused."""
    batch = CompiledBatch(robot)
    batch.threads = 10**9
    assert batch.threads == available()
    for wrong in (0, -3, 2.5, "2"):
        with pytest.raises(NcgenError, match="it must be a whole number from 1 on, or None"):
            batch.threads = wrong
    batch.threads = None
    assert batch.threads == available()


def test_kernels_that_are_not_needed_give_zeros(robot):
    assert np.array_equal(robot.batch.nu(states(robot)[0]), np.zeros((COUNT, robot.m)))


def test_no_states(robot):
    """A batch of none is none."""
    assert robot.batch.phi(np.zeros((0, robot.n))).shape == (0, robot.m)


@pytest.mark.parametrize("backend", ["numpy", "c"])
def test_rows_that_have_a_point_in_common(backend):
    """A hub that six rods hold: every run of the loop reads the same coordinates, others far apart, and others side by side."""
    model = ncgen.Model("star")
    hub, angles = model.point("H", (0.1, 0.2)), 2 * np.pi * np.arange(6) / 6
    rims = [model.point(f"R{i}", (2 * np.cos(a), 2 * np.sin(a))) for i, a in enumerate(angles)]
    for i, rim in enumerate(rims):
        model.distance(hub, rim, 1.0 + i)
    kernels = ncgen.compile(model, backend, "tabled")
    q = np.random.default_rng(5).standard_normal((3, kernels.n))
    at = {name: q[:, i] for i, name in enumerate(kernels.coordinates)}
    for i, row in enumerate(kernels.batch.phi(q).T):
        square = (at["H.x"] - at[f"R{i}.x"]) ** 2 + (at["H.y"] - at[f"R{i}.y"]) ** 2
        ratio = row / (square - (1.0 + i) ** 2)
        np.testing.assert_allclose(ratio, ratio[0], rtol=1e-13)
        assert ratio[0] > 0
