"""Studies: what they find is right, is a variant's own, and is told where there is nothing to find."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from study_models import fragile, swing

import ncgen
import ncgen.studies.result
from ncgen.studies.definition import Study
from ncgen.studies.variants import Bench

KEEP = ("psi", "rate(psi)", "square", "max(psi)", "min(psi)", "history(psi)", "energy_drift", "steps", "time")
SWINGS = {"length": {"low": 0.8, "high": 1.2}, "start(rate(psi))": {"low": 1.0, "high": 2.0}}
TIMES = (0.3, 0.7)


def swings(count: int, **options) -> ncgen.studies.result.StudyResult:
    given = {"keep": KEEP, "times": TIMES, "duration": 2.0, "rtol": 1e-9, **options}
    return ncgen.study(swing(), SWINGS, design="sobol", count=count, seed=2, **given)


@pytest.fixture(scope="module")
def found():
    return swings(64)


def pendulum(length: float, rate: float, times) -> np.ndarray:
    """ψ and ψ̇ of a rod on a hinge, ψ̈ = −3 g sin ψ / (2 L), by SciPy."""
    run = solve_ivp(
        lambda t, y: [y[1], -1.5 * 9.81 / length * np.sin(y[0])], (0, times[-1]), [0.0, rate], "DOP853", times, rtol=1e-12, atol=1e-13
    )
    return run.y


def test_columns_are_those_of_another_program(found):
    fine = np.linspace(0, 2, 4001)
    for i in (0, 17, 63):
        psi, rate = pendulum(found["length"][i], found["start(rate(psi))"][i], fine)
        own = {name: found[name][i] for name in KEEP}
        assert (own["psi"], own["rate(psi)"]) == pytest.approx((psi[-1], rate[-1]), abs=1e-6)
        assert own["square"] == pytest.approx(rate[-1] ** 2, abs=1e-6)
        assert (own["max(psi)"], own["min(psi)"]) == pytest.approx((psi.max(), psi.min()), abs=2e-6)
        assert own["history(psi)"] == pytest.approx(psi[[600, 1400]], abs=1e-6)
        assert own["energy_drift"] < 1e-7 and own["steps"] > 20 and own["time"] == 2.0


def test_what_runs_alone_finds_the_same(found):
    """Another formalism, one at a time by `simulate`, whose own values the columns are."""
    alone = swings(64, formalism="lagrange", integrator="dop853")
    assert "one at a time" in alone.about["made_with"] and "in lanes" in found.about["made_with"]
    for name in ("psi", "square", "max(psi)", "min(psi)", "history(psi)"):
        assert alone[name] == pytest.approx(found[name], abs=2e-6), name


@pytest.mark.parametrize("options", [{}, {"formalism": "lagrange", "integrator": "dop853"}])
def test_bits_are_a_variants_own(options):
    """In any chunk, any order, with any threads, on another bench."""
    study = Study.of(swing(), SWINGS, design="random", count=60, keep=KEEP, times=TIMES, simulation={"duration": 1.0, **options})
    bench, other = Bench(study), Bench(pickle.loads(pickle.dumps(study)))
    whole = bench.part(0, 60, threads=2)
    for first, count in ((59, 1), (0, 1), (20, 13), (1, 59)):
        part = other.part(first, count, threads=1)
        assert all(np.array_equal(part.columns[name], whole.columns[name][first : first + count]) for name in whole.columns)


def test_three_of_a_thousand_fail_and_are_told():
    """One cannot close, one is no number, one locks; the others are what single runs give."""
    speed, reach = np.linspace(0.02, 0.1, 1000), np.full(1000, 0.4)
    reach[10], reach[500], speed[999] = 0.1, np.nan, 1.5
    options = {"duration": 0.2, "rtol": 1e-8}
    found = ncgen.study(fragile(), {"speed": speed, "reach": reach}, design="list", keep=["D.x", "steps"], **options)
    assert found.ok.sum() == 997 and sorted(found.failures) == [10, 500, 999]
    assert "does not close" in found.failures[10] and "reach is nan" in found.failures[500] and "t = 0.05" in found.failures[999]
    assert np.isnan(found["D.x"][~found.ok]).all() and np.isfinite(found["D.x"][found.ok]).all()
    kernels = ncgen.compile(fragile())
    for i in (0, 9, 11, 499, 501, 998):
        own = {"formalism": "coordinate-partitioning", "integrator": "dopri5", "engine": "emitted", "points": 2}
        run = ncgen.simulate(kernels, p={"speed": speed[i], "reach": reach[i]}, **own, **options)
        assert found["steps"][i] == run.statistics.steps and found["D.x"][i] == pytest.approx(run["D.x"][-1], abs=1e-12)
    good = np.flatnonzero(found.ok)
    again = ncgen.study(fragile(), {"speed": speed[good], "reach": reach[good]}, design="list", keep=["D.x", "steps"], **options)
    assert np.array_equal(again["D.x"], found["D.x"][good]) and np.array_equal(again["steps"], found["steps"][good])


def test_a_study_in_which_nothing_starts():
    found = ncgen.study(fragile(), {"reach": [0.1, np.nan]}, keep="D.x", duration=0.1)
    assert not found.ok.any() and len(found.failures) == 2


def test_stops_and_times():
    found = ncgen.study(swing(), {"length": [0.9, 1.1]}, keep=["psi", "time"], duration=2.0, zd0={"psi": 2.0}, stop={"psi": 0.3})
    assert found["psi"] == pytest.approx(0.3, abs=1e-9) and (found["time"] < 0.3).all()


def test_the_digest_tells_studies_apart():
    def digest(vary=SWINGS, model=None, **options):
        return Study.of(model or swing(), vary, **{"design": "sobol", "count": 8, "keep": "psi", **options}).digest

    own = digest()
    assert own == digest() and own == digest(count=8)
    others = [
        digest(count=16), digest(seed=1), digest(keep="rate(psi)"), digest(design="halton"), digest(simulation={"rtol": 1e-9}),
        digest(model=fragile(), vary={"speed": {"low": 0, "high": 1}}, keep="D.x"),
        digest({**SWINGS, "length": {"low": 0.8, "high": np.nextafter(1.2, 2)}}),
    ]  # fmt: skip
    assert len({own, *others}) == len(others) + 1


@pytest.mark.parametrize(
    "vary, options, said",
    [
        ({"lenght": [1.0]}, {}, "vary: the mechanism has no parameter lenght; it has length, mass, g"),
        ({"psi": [1.0]}, {}, r"vary, psi: it is a coordinate, whose start varies; write start\(psi\)"),
        ({"start(phi)": [1.0]}, {}, r"vary, start\(phi\): the mechanism has no free coordinate phi"),
        ({"length": [1.0]}, {"keep": []}, "keep: nothing is kept"),
        ({"length": [1.0]}, {"keep": ["psi", "psi"]}, "keep: psi is named twice"),
        ({"length": [1.0]}, {"keep": "max(phi)"}, "keep: swing has no coordinate or output phi"),
        ({"length": [1.0]}, {"keep": "history(psi)"}, "times: history"),
        ({"length": [1.0]}, {"keep": "history(psi)", "times": [3.0]}, "the run goes from 0 to 1 s"),
        ({"length": [1.0]}, {"rtol": -1}, "rtol: -1 given; it must be a positive number"),
        ({"length": [1.0]}, {"integrator": "euler"}, "integrator"),
        ({"length": [1.0]}, {"speed": 1}, r"study: there is no argument 'speed'"),
        ({"length": [1.0]}, {"p": [1.0, 2.0, 9.81]}, "p: some of it varies; give the rest by name"),
        ({"length": [1.0]}, {"workers": 0}, "workers is 0"),
        ({"length": [1.0]}, {"workers": 1.5}, "workers: 1.5 given"),
        (
            {"start(rate(B.x))": [1.0]},
            {},
            "initial velocity of B.x: it is not independent; the independent coordinates are psi",
        ),
    ],
)
def test_mistakes_are_named(vary, options, said):
    with pytest.raises(ncgen.ModelError, match=said) as caught:
        ncgen.study(swing(), vary, **{"keep": "psi", "duration": 1.0, **options})
    assert "\n" not in str(caught.value)


def test_models_that_cannot_travel():
    model = swing()
    model.callback(lambda t, q, qd: np.zeros_like(q))
    with pytest.raises(ncgen.ModelError, match="a force is a Python function"):
        Study.of(model, {"length": [1.0]}, keep="psi")


def test_tables(found):
    table = found.table()
    assert list(table)[:4] == ["variant", "length", "start(rate(psi))", "ok"] and "history(psi) at 0.3 s" in table
    assert set(table["status"]) == {"ok"} and all(len(column) == 64 for column in table.values())
    with pytest.raises(ncgen.ModelError, match="the study has no column phi"):
        found["phi"]


def test_sobol_indices():
    """Of the function of Ishigami and Homma, whose shares are known."""
    from ncgen.studies.design import Design
    from ncgen.studies.indices import indices

    unit = {"low": 0.0, "high": 1.0}
    rows = Design.of({"a": unit, "b": unit, "c": unit}, "saltelli", 1024, 3).rows(0, 5 * 1024)
    a, b, c = (np.pi * (2 * rows - 1)).T
    ishigami = np.sin(a) + 7 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)
    found = indices(("a", "b", "c"), ishigami)
    assert found.first == pytest.approx([0.3139, 0.4424, 0.0], abs=0.02)  # Ishigami & Homma 1990
    assert found.total == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.02)
    ishigami[5] = np.nan
    assert indices(("a", "b", "c"), ishigami).points == 512


def test_extremes_of_cubics():
    """A sine on 20 instants: its top between them to the error of cubics, h⁴/384."""
    from ncgen.studies.extremes import extremes

    t = np.linspace(0, 6, 20)
    low, high = extremes(t, np.sin(t)[None], np.cos(t)[None])
    assert high[0] == pytest.approx(1.0, abs=0.3158**4 / 384 * 1.1) and low[0] == pytest.approx(-1.0, abs=0.3158**4 / 384 * 1.1)
    assert high[0] > np.sin(t).max() and low[0] < np.sin(t).min()
    assert extremes(t, t[None], np.ones((1, 20)))[1] == 6.0
