"""Gradients of many motions: each is that of its own motion, whatever stands beside it, and what one state lacks costs no other."""

from __future__ import annotations

import time

import numpy as np
import pytest
import sympy
from test_sensitivity import linkage

import ncgen
from ncgen import ModelError
from ncgen.mechanism import batch_runs, kernel_batch, motions, taped
from ncgen.solver.derivatives import gradients, taped_batch

DURATION, STEPS = 0.4, 20


@pytest.fixture(scope="module")
def kernels():
    return ncgen.compile(linkage())


def objective(q, qd):
    by_q = np.zeros_like(q)
    by_q[-1] = q[-1]
    by_q[3, 0] = 2.0
    return np.sum(q[-1] ** 2) / 2 + 2 * q[3, 0] + qd.sum(), by_q, np.ones_like(qd)


def variants(kernels, count):
    """Parameters (count, n_p) and initial rates (count, 1)."""
    rng = np.random.default_rng(3)
    p = kernels.p0 * (1 + 0.02 * rng.standard_normal((count, len(kernels.p0))))
    p[:, kernels.parameters.index("foot")] = kernels.p0[kernels.parameters.index("foot")]
    return p, rng.uniform(-1, 1, (count, 1))


def alone(kernels, p, zd0, integrator="rk4"):
    found = ncgen.gradient(kernels, DURATION, STEPS, objective, integrator=integrator, p=p, zd0=zd0, z="psi")
    return found.value, np.array(list(found.derivatives.values())), tuple(found.derivatives)


@pytest.mark.parametrize("integrator", ["rk4", "dop853"])
def test_each_is_its_own(kernels, integrator):
    """Values and slopes of 19 variants with their own lengths, which is no number of full vectors, to rounding."""
    p, zd0 = variants(kernels, 19)
    found = ncgen.gradient(kernels, DURATION, STEPS, objective, integrator=integrator, p=p, zd0=zd0, z="psi")
    assert found.ok.all() and not found.alone.any() and found.derivatives.shape == (19, len(kernels.p0) + 2)
    for i in range(19):
        value, slopes, names = alone(kernels, p[i], zd0[i], integrator)
        assert names == found.names
        assert found.values[i] == pytest.approx(value, rel=1e-13)
        np.testing.assert_allclose(found.derivatives[i], slopes, rtol=0, atol=1e-12 * np.max(np.abs(slopes)))


def test_bits_do_not_depend_on_company(kernels, monkeypatch):
    """Neither on threads nor on which states share a part."""
    p, zd0 = variants(kernels, 40)

    def found(count, threads):
        return ncgen.gradient(kernels, DURATION, STEPS, objective, p=p[:count], zd0=zd0[:count], z="psi", threads=threads)

    one = found(40, 1)
    monkeypatch.setattr(kernel_batch, "available", lambda: 3)
    monkeypatch.setattr(motions, "TAPED", 1)
    three, few = found(40, 3), found(11, 1)
    assert np.array_equal(one.derivatives, three.derivatives) and np.array_equal(one.values, three.values)
    assert np.array_equal(one.derivatives[:11], few.derivatives)


def test_a_state_that_goes_otherwise_has_a_run_of_its_own(kernels, monkeypatch):
    """What lanes hand back is computed alone, to the bits of the single call; the others stay as they are."""
    p, zd0 = variants(kernels, 12)
    plain, run = ncgen.gradient(kernels, DURATION, STEPS, objective, p=p, zd0=zd0, z="psi"), motions.Motions.run

    def some(self, *start):
        done = run(self, *start)
        some_of_these = np.isin(start[2][:, 0], p[[2, 7], 0])
        done.other[some_of_these], done.q[some_of_these] = True, np.nan
        return done

    monkeypatch.setattr(motions.Motions, "run", some)
    found = ncgen.gradient(kernels, DURATION, STEPS, objective, p=p, zd0=zd0, z="psi")
    assert np.flatnonzero(found.alone).tolist() == [2, 7] and found.ok.all()
    for i in range(12):
        expected = alone(kernels, p[i], zd0[i])[1] if i in (2, 7) else plain.derivatives[i]
        assert np.array_equal(found.derivatives[i], expected)


def test_what_cannot_move_says_why_and_costs_nothing_else(kernels):
    """A crank that is too long, a mass that is no number and a start that runs away beside good ones."""
    p, zd0 = variants(kernels, 9)
    crank, mass = (kernels.parameters.index(name) for name in ("crank", "m1"))
    q0 = ncgen.assemble(kernels, kernels.q0)
    p[:, : len(kernels.p0)] = kernels.p0
    p[1, crank], p[4, mass], zd0[6] = 30.0, np.nan, 1e5
    found = ncgen.gradient(kernels, DURATION, STEPS, objective, p=p, zd0=zd0, q0=q0, z="psi")
    assert [found.status[i] == "ok" for i in range(9)] == [i not in (1, 4, 6) for i in range(9)]
    assert np.isnan(found.derivatives[[1, 4, 6]]).all() and np.isnan(found.values[[1, 4, 6]]).all()
    for i in (1, 4, 6):
        with pytest.raises(ncgen.NcgenError) as refused:
            ncgen.gradient(kernels, DURATION, STEPS, objective, p=p[i], zd0=zd0[i], q0=q0, z="psi")
        assert found.status[i] == str(refused.value) or i != 6
    for i in (0, 8):
        slopes = ncgen.gradient(kernels, DURATION, STEPS, objective, p=p[i], zd0=zd0[i], q0=q0, z="psi").derivatives
        np.testing.assert_allclose(found.derivatives[i], list(slopes.values()), rtol=0, atol=1e-12 * max(map(abs, slopes.values())))


def test_progress_and_what_is_raised(kernels):
    """The share of what is done ascends to the whole; what the objective or the progress raises ends the call."""
    p, zd0 = variants(kernels, 30)
    given, told = {"p": p, "zd0": zd0, "z": "psi"}, []
    ncgen.gradient(kernels, DURATION, STEPS, objective, **given, progress=told.append, threads=1)
    assert told == sorted(told) and told[-1] == 1.0

    def broken(q, qd):
        raise ArithmeticError("enough")

    for threads in (1, 2):
        with pytest.raises(ArithmeticError, match="enough"):
            ncgen.gradient(kernels, DURATION, STEPS, broken, **given, threads=threads)


def test_refusals(kernels):
    """In the words of `gradient` and of `simulate`."""
    given = {"zd0": np.zeros((3, 1)), "z": "psi"}

    def refused(*arguments, **options):
        with pytest.raises(ModelError) as caught:
            ncgen.gradient(*arguments, **{**given, **options})
        return str(caught.value)

    assert refused(kernels, 0.1, 0, objective) == "steps: 0 given; a motion has at least 1"
    assert refused(kernels, 0.1, 2, objective, integrator="radau").startswith("integrator: 'radau' given; derivatives go through steps of")
    assert refused(kernels, -1, 2, objective).startswith("duration: ")
    assert refused(kernels, 0.1, 2, objective, zd0={"C.x": [1.0]}).startswith("initial velocity of C.x: it is not independent")
    assert "rows; a batch has one number of them" in refused(kernels, 0.1, 2, objective, p=np.ones((2, len(kernels.p0))))
    assert refused(kernels, 0.1, 2, objective, threads=0).startswith("threads: 0 given")
    plain = ncgen.compile(linkage(), backend="numpy")
    assert "its motion is not emitted in C" in refused(plain, 0.1, 2, objective, integrator="dop853")
    found = ncgen.gradient(kernels, 0.1, 4, objective, **given)
    assert repr(found).startswith("<BatchGradients by crank, rise, foot") and repr(found).endswith("3 of 3 states>")
    with pytest.raises(ModelError, match="there is no derivative by 'nothing'; there are crank"):
        found.by("nothing")


@pytest.mark.slow
def test_two_threads_are_nearly_twice_as_quick(monkeypatch):
    """On two processors that have nothing else to do, as motions in threads of C tell: the best of turns.

    Of states in lanes: two of these come near a singular position, run alone in Python, and would take a third of the time.
    """
    monkeypatch.delattr(taped_batch.TapedBatch, "_alone")
    if kernel_batch.available() < 2:
        pytest.skip("one processor")
    kernels = ncgen.compile(ncgen.load("robot"))
    zd0 = np.delete(0.1 * np.random.default_rng(1).standard_normal((800, 6)), [520, 747], axis=0)
    tools = {
        "gradients": lambda threads: ncgen.gradient(kernels, 0.5, 100, objective, zd0=zd0, threads=threads),
        "motions": lambda threads: ncgen.simulate(kernels, 0.5, zd0=zd0, threads=threads, rtol=1e-10, points=20),
    }
    spent = {(tool, threads): [] for tool in tools for threads in (1, 2)}
    for _ in range(9):
        for (tool, threads), times in spent.items():
            begun = time.perf_counter()
            tools[tool](threads)
            times.append(time.perf_counter() - begun)
    gain = {tool: min(spent[tool, 1]) / min(spent[tool, 2]) for tool in tools}
    if gain["motions"] < 1.7:
        pytest.skip(f"no two processors with nothing else to do: threads in C gain {gain['motions']:.2f}")
    assert gain["gradients"] > 1.7, gain


def test_parts_end_with_what_is_raised():
    """Parts that have not begun never do."""
    begun = []

    def task(item):
        begun.append(item)
        if item == 1:
            raise ArithmeticError("enough")
        time.sleep(0.01)
        return item

    with pytest.raises(ArithmeticError, match="enough"):
        list(taped_batch.side_by_side(task, range(100), 2))
    assert len(begun) < 20


@pytest.mark.parametrize("steps", [1, 30])
def test_lanes_stay_within_their_memory(kernels, monkeypatch, steps):
    """Kernels, runs and gradients of many states leave what stands behind their workspaces and tapes as it is."""
    aligned, guards = kernel_batch.aligned, []

    def guarded(count):
        whole = aligned(count + 4096)
        whole[count:] = 7.0
        guards.append(whole[count:])
        return whole[:count]

    for module in (kernel_batch, batch_runs, motions, taped):
        monkeypatch.setattr(module, "aligned", guarded)
    p, zd0 = variants(kernels, 9)
    for integrator in ("rk4", "dop853"):
        found = ncgen.gradient(
            kernels, 0.01 * steps, steps, lambda q, qd: (0.0, q, qd), integrator=integrator, p=p, zd0=zd0, z="psi", threads=1
        )
        assert found.ok.all()
    ncgen.simulate(kernels, 0.1, p=p, zd0=zd0, z="psi", points=3, threads=1)
    q = np.tile(kernels.q0, (9, 1))
    for name in kernels.programs.programs:
        kernels.batch.values(name, 0.0, q, q, p)
    assert len(guards) > len(kernels.programs.programs)
    assert all(np.all(guard == 7.0) for guard in guards)


def test_positions_are_closed_in_lanes(kernels):
    """Steps of a tenth of a second leave the constraints by far more."""
    left = []

    def weigh(q, qd):
        left.extend(np.abs(kernels.phi(row)) / kernels.row_sizes for row in q)
        return 0.0, np.zeros_like(q), np.zeros_like(q)

    p, zd0 = variants(kernels, 9)
    p[:] = kernels.p0  # by which phi judges
    found = ncgen.gradient(kernels, 0.5, 5, weigh, p=p, zd0=3 * zd0, z="psi")
    assert found.ok.all() and not found.alone.any()
    assert len(left) == 9 * 6 and np.max(left) < 1e-12


def test_states_without_weights_have_rows_and_no_slopes(kernels):
    """Those of their own runs, though nothing is gone back through; one whose crank is too long has none."""
    p, zd0 = variants(kernels, 9)
    p[4, kernels.parameters.index("crank")] = 30.0
    q, qd = (np.zeros((9, STEPS + 1, kernels.n)) for _ in range(2))
    given = {"q0": ncgen.assemble(kernels), "z": "psi"}
    found = gradients.taped_batch(kernels, DURATION, STEPS, "rk4", p=p, zd0=zd0, **given).sweep(None, rows=(q, qd))
    assert [word == "ok" for word in found.status] == [i != 4 for i in range(9)] and np.isnan(found.derivatives).all()
    assert np.isnan(q[4]).all() and np.isnan(qd[4]).all()
    for i in (0, 3, 5, 8):
        own = ncgen.sensitivities(kernels, DURATION, STEPS, p=p[i], zd0=zd0[i], by=[], **given)
        np.testing.assert_allclose(q[i], own.q, rtol=0, atol=1e-12)
        np.testing.assert_allclose(qd[i], own.qd, rtol=0, atol=1e-11)


@pytest.mark.parametrize("rod", [True, False], ids=["in lanes", "alone"])
def test_a_number_that_is_none_is_seen_wherever_it_is(rod):
    """Three particles are pushed along x and y by √w: each state but the last has a w below 0, another one; the last follows its parabolas.

    A rod that swings beside them makes it a motion that is written out, and goes in lanes.
    """
    model = ncgen.Model("particles")
    count = 6
    w = [model.parameter(f"w{i}", 1.0 + i) for i in range(count)]
    for i in range(3):
        point = model.point(f"P{i}", (i, 1.0))
        model.body(f"b{i}", points=[point], mass=1.0)
        model.force(point, (sympy.sqrt(w[2 * i]), sympy.sqrt(w[2 * i + 1]), 0))
    if rod:
        A, B = model.point("A", (0, 0), fixed=True), model.point("B", (0.6, 0.8))
        model.body("rod", points=[A, B], mass=1.0, inertia="point")
    kernels = ncgen.compile(model)
    p = np.tile(kernels.p0, (count + 1, 1))
    p[range(count), range(count)] = -1.0
    last = []

    def end(q, qd):
        last.append(q[-1, :count])
        by_q = np.zeros_like(q)
        by_q[-1, :count] = 1.0
        return float(last[-1].sum()), by_q, np.zeros_like(q)

    found = ncgen.gradient(kernels, 0.5, 5, end, p=p)
    assert found.alone[-1] != rod
    said = [word.partition(" is not a number")[0] for word in found.status]
    assert said == [*(f"particles: force on P{i // 2}" for i in range(count)), "ok"]
    assert np.isnan(found.values[:-1]).all() and np.isnan(found.derivatives[:-1]).all()
    np.testing.assert_allclose(last[-1], kernels.q0[:count] + np.sqrt(kernels.p0) * 0.5**2 / 2, rtol=1e-14)
    np.testing.assert_allclose(found.derivatives[-1, :count], 0.5**2 / 4 / np.sqrt(kernels.p0), rtol=1e-13)
