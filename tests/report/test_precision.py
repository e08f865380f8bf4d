"""`ncgen bench --precision`: errors fall as tolerances do, the front is the quickest, and no method is lost."""

import numpy as np
import pytest

import ncgen
from ncgen.report import precision
from ncgen.report.methods import methods


@pytest.fixture(scope="module")
def records():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(precision, "TOLERANCES", (1e-4, 1e-8))
        patch.setattr(precision, "STEPS", (50, 100))
        patch.setattr(precision, "SHORT", 0.0)
        patch.setattr(precision, "own_run", lambda kernels: (0.1, {"zd0": {"B.y": -5.0}}))
        return list(precision.precision_records(ncgen.load("pendulum"), limit=3.0))


def test_every_method_is_there(records):
    """With a result or with the reason why there is none."""
    assert {(r["formalism"], r["integrator"]) for r in records} == set(methods())
    assert all((r["error"] is None) == (r["reason"] is not None) for r in records)
    assert {"emitted", "c", "python"} <= {r["engine"] for r in records}


def test_tighter_is_better(records):
    """From 1e-4 to 1e-8, every method with error control gains at least two digits, or is better than asked for."""
    for method, runs in precision.by_method(records).items():
        done = [r["error"] for r in runs if r["error"] is not None and r["setting"].startswith("rtol")]
        if len(done) == 2 and "penalty" not in method:
            assert done[1] < max(done[0] / 100, 1e-8), method


def test_the_front_is_the_quickest(records):
    for target, line in zip(precision.TARGETS, precision.front(records), strict=True):
        enough = [r for r in records if r["error"] is not None and r["error"] <= target]
        best = min(enough, key=lambda r: r["seconds"], default=None)
        assert best is None or best["method"] in line


def test_the_reference_is_trusted_and_kept(tmp_path, monkeypatch):
    """Two methods agree to ten digits; the second question is answered from the file."""
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path))
    kernels = ncgen.compile(ncgen.load("pendulum"), "c")
    first = precision.reference(kernels, 1.0, {})
    assert first.doubt < 1e-10
    monkeypatch.setattr(precision, "simulate", None)
    again = precision.reference(kernels, 1.0, {})
    assert np.array_equal(first.q, again.q) and first.doubt == again.doubt
