"""`ncgen bench --precision`: errors fall as tolerances do, the front is the quickest, and no method is lost."""

import json

import numpy as np
import pytest

import ncgen
from ncgen.methods.table import FORMALISMS
from ncgen.report import precision


@pytest.fixture(scope="module")
def records():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(precision, "TOLERANCES", (1e-4, 1e-8))
        patch.setattr(precision, "STEPS", (50, 100))
        patch.setattr(precision, "ROUNDS", 2)
        return precision.precision_records(ncgen.load("pendulum"), limit=3.0, duration=0.1, zd0={"B.y": -5.0})


def test_every_method_is_there(records):
    """With a result or with the reason why there is none."""
    assert {(r["formalism"], r["integrator"]) for r in records} == set(precision.tried())
    assert {r["formalism"] for r in records} == set(FORMALISMS)
    assert all((r["error"] is None) == (r["reason"] is not None) for r in records)
    assert {"emitted", "c", "python"} <= {r["engine"] for r in records}


def test_tighter_is_better(records):
    """From 1e-4 to 1e-8, every method with error control gains at least two digits, or is better than asked for."""
    for method, runs in precision.by_method(records).items():
        done = [r["error"] for r in runs if r["error"] is not None and r["setting"].startswith("rtol")]
        if len(done) == 2 and "penalty" not in method and runs[0]["number"] != "float":
            assert done[1] < max(done[0] / 100, 1e-8), method


def test_fourth_order_is_seen(records):
    """Half the step leaves a sixteenth of the error of the classical method, with any formalism that holds the constraints."""
    for method, runs in precision.by_method(records).items():
        if runs[0]["integrator"] == "rk4" and "penalty" not in method and runs[0]["number"] != "float":
            errors = [r["error"] for r in runs]
            assert 3.5 < np.log2(errors[0] / errors[1]) < 5.5, method


def test_float_ends_at_its_rounding(records):
    """24 bits are 6e-8; some steps add some of them up."""
    for integrator in precision.WRITTEN_OUT:
        errors = [r["error"] for r in records if r["number"] == "float" and r["integrator"] == integrator]
        assert len(errors) == 2 and 1e-9 < min(errors) < 5e-6


def test_times_have_a_spread(records):
    done = [r for r in records if r["error"] is not None]
    assert all(0 < r["low"] <= r["seconds"] <= r["high"] for r in done)
    assert json.loads(json.dumps(records)) == records


def record(name, error, seconds):
    plain = {
        "formalism": "lagrange",
        "integrator": name,
        "engine": "c",
        "kernels": "c",
        "number": "double",
        "setting": "",
        "noisy": False,
        "reference_error": 1e-7,
    }
    return plain | {"method": name, "error": error, "seconds": seconds}


def test_the_front_is_the_quickest():
    """Of four runs b is beaten by c, which is quicker and more exact; below the doubt nothing is said."""
    runs = [record("a", 1e-2, 1.0), record("b", 1e-3, 4.0), record("c", 1e-4, 2.0), record("d", 1e-8, 9.0)]
    assert [r["method"] for r in precision._unbeaten(runs)] == ["d", "c", "a"]
    said = [line.split(": ")[1].split(",")[0] for line in precision.front(runs)]
    assert said == ["a", "c", "c", "d", "d"]  # for 1e-2 to 1e-6


def test_the_reference_is_trusted_and_kept(tmp_path, monkeypatch):
    """Two methods agree to ten digits; the second question is answered from the file."""
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path))
    kernels = ncgen.compile(ncgen.load("pendulum"), "c")
    first = precision.reference(kernels, 1.0, {})
    assert first.doubt < 1e-10
    monkeypatch.setattr(precision, "simulate_one", None)
    again = precision.reference(kernels, 1.0, {})
    assert np.array_equal(first.q, again.q) and first.doubt == again.doubt


# -- the motion that is chosen ------------------------------------------------------------------


ROD = """
import ncgen


def build():
    m = ncgen.Model("rod")
    L = m.parameter("L", 1.0)
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (L, 0))
    m.body("bob", [B], mass=1.0)
    m.distance(A, B)
    return m
"""
"""It has no weight, so it turns evenly from the velocity that it is given, and rests without."""


@pytest.fixture
def bench(tmp_path, monkeypatch, capsys):
    """`ncgen bench rod.py …` with one method only: (what it prints, its exit code)."""
    from ncgen import cli

    (tmp_path / "rod.py").write_text(ROD)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(precision, "tried", lambda: [("lagrange", "dop853")])
    monkeypatch.setattr(precision, "TOLERANCES", (1e-6,))

    def call(*arguments):
        monkeypatch.setattr("sys.argv", ["ncgen", "bench", "rod.py", *arguments])
        try:
            code = cli.main()
        except SystemExit as end:
            code = end.code
        said = capsys.readouterr()
        return said.out + said.err, code or 0

    return call


def test_the_motion_is_chosen_as_for_run(bench, monkeypatch):
    """2 m long and at 2 m/s at its end: after 0.5 s it has turned by 0.5 rad."""
    ends, of = [], precision.reference
    monkeypatch.setattr(precision, "reference", lambda *given: ends.append(of(*given)) or ends[-1])
    printed, code = bench("--precision", "--duration", "0.5", "--velocity", "B.y=2", "--param", "L=2", "--json")
    assert code == 0
    assert ends[0].q == pytest.approx([2 * np.cos(0.5), 2 * np.sin(0.5)], abs=1e-10)
    assert 0 < json.loads(printed)["records"][0]["error"] < 1e-4


@pytest.mark.parametrize(
    "options, words",
    [
        (["--precision"], "rod: nothing moves in 1 s, so every method is exact; give a start velocity, such as --velocity B.y=1"),
        (["--precision", "--velocity", "C.y=1"], "--velocity C.y=1: the mechanism has no free coordinate C.y; it has B.x, B.y"),
        (["--precision", "--velocity", "B.y"], "--velocity B.y: write it as name=number"),
        (["--precision", "--duration", "-1"], "duration: -1.0 given; it must be a positive number of seconds"),
        (["--velocity", "B.y=1"], "--velocity: only with --precision a motion can be chosen; add --precision"),
        (["--duration", "0"], "--duration: only with --precision a motion can be chosen; add --precision"),
    ],
)
def test_motions_are_refused_before_anything_is_measured(bench, monkeypatch, options, words):
    monkeypatch.setattr(precision, "reference", None)
    printed, code = bench(*options)
    assert code == 2 and words in printed and len(printed.strip().splitlines()) == 1, printed
