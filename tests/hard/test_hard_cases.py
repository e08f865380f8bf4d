"""The hard cases: which method must survive which, to what error, and that every failure is said in words."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

import ncgen
from ncgen.cli import app
from ncgen.comparisons.hard import hard_records, methods, run_case
from ncgen.comparisons.hard_cases import CASES
from ncgen.comparisons.hard_tops import PRINCIPAL, SPIN, free_rotation
from ncgen.report.precision import FIXED

SURVIVES = [
    ("parallelogram", "lagrange", "dop853", 1e-6),
    ("nfourbar-2", "lagrange", "dop853", 1e-6),
    ("nfourbar-10", "lagrange", "dop853", 1e-6),
    ("nfourbar-40", "lagrange", "dop853", 1e-6),
    ("nfourbar-2", "null-space", "dop853", 1e-6),
    ("nfourbar-2", "augmented-lagrangian", "dop853", 1e-6),
    ("nfourbar-2", "udwadia-phohomsiri", "dop853", 1e-6),
    ("robot", "coordinate-partitioning", "dopri5", 1e-8),
    ("robot", "lagrange", "dop853", 1e-8),
    ("equal-crank", "lagrange", "dop853", 1e-6),
    ("bricard", "lagrange", "dop853", 1e-6),
    ("bricard", "penalty", "dop853", 1e-5),
    ("squeezer", "coordinate-partitioning", "dop853", 1e-8),
    ("squeezer", "lagrange", "dop853", 1e-8),
    ("heavy-top", "lagrange", "dop853", 1e-7),
    ("free-body", "lagrange", "dop853", 1e-9),
    ("near-parallel", "lagrange", "dop853", 1e-6),
    ("light-upper", "lagrange", "dop853", 1e-6),
    ("light-lower", "lagrange", "dop853", 1e-6),
    ("pendulum-1e-06", "lagrange", "dop853", 1e-8),
    ("pendulum-1e+06", "lagrange", "dop853", 1e-8),
    ("massless", "lagrange", "dop853", 1e-8),
    ("violated", "lagrange", "dop853", 1e-8),
]


@pytest.mark.parametrize(("name", "formalism", "integrator", "allowed"), SURVIVES)
def test_survives(name, formalism, integrator, allowed):
    """The error against the independent solution stays small; nothing is warned away.

    Where a linkage lies flat rounding decides how near to that a stage comes, and with it the error at single tolerances, one in a hundred
    of them, others with every compiler's flags: a linkage has the middle one of five runs.
    """
    case, kernels = CASES[name], ncgen.compile(CASES[name].build(), "c")
    factors = (0.8, 0.9, 1.0, 1.1, 1.2) if case.breaks.startswith("flattens") else (1.0,)
    found = [run_case(kernels, replace(case, rtol=factor * case.rtol), formalism, integrator) for factor in factors]
    errors = sorted(np.inf if each["reason"] else each["error"] for each in found)
    assert errors[len(errors) // 2] < allowed, found


@pytest.mark.parametrize("formalism", ["null-space", "augmented-lagrangian", "udwadia-phohomsiri"])
def test_whichever_redundant_constraint_is_left_out_the_error_is_below_the_tolerance(formalism):
    """The energy integral to 34 digits; over all choices of the one that is left out the errors go from 6e-15 to 7e-11."""
    case = CASES["bricard"]
    assert run_case(ncgen.compile(case.build(), "c"), case, formalism, "dop853")["error"] < case.rtol


def test_errors_of_tolerances_that_differ_by_rounding():
    """They go from 3e-13 to 2e-10, beside 40 digits, so that one of them says little; the middle one is of the size of the tolerance."""
    case, kernels = CASES["squeezer"], ncgen.compile(CASES["squeezer"].build(), "c")
    nearly_equal = [replace(case, rtol=case.rtol * (1 + 1e-12 * k)) for k in range(-4, 5)]
    errors = [run_case(kernels, each, "coordinate-partitioning", "dop853")["error"] for each in nearly_equal]
    assert np.median(errors) < 4 * case.rtol


@pytest.mark.parametrize("formalism", ["lagrange", "null-space", "augmented-lagrangian", "udwadia-phohomsiri"])
def test_through_the_flat_position_the_error_follows_the_tolerance(formalism):
    """Also where rounding decides whether a step beside it is refused: a repeated one settles its stages.

    With lagrange rounding decides more: of 903 runs (301 tolerances, three compilers' flags) 18 had an error beyond 1000 rtol, the largest
    2e-5 m, as rounding leaves it whatever the tolerance. Three of seven by chance would be one run of this test in 4,000.
    """
    case = CASES["nfourbar-2"]
    kernels = ncgen.compile(case.build(), "c")
    found = {
        rtol: run_case(kernels, replace(case, rtol=rtol), formalism, "dop853") for rtol in (1e-8, 3e-9, 1e-9, 3e-10, 1e-10, 3e-11, 1e-11)
    }
    assert all(each["reason"] is None for each in found.values())
    by_chance, factor = (2, 1000) if formalism == "lagrange" else (0, 500)
    larger = [rtol for rtol, each in found.items() if not each["error"] < factor * rtol]
    assert len(larger) <= by_chance and all(found[rtol]["error"] < 1e-4 for rtol in larger), larger


def test_energy_of_bricard_for_ten_seconds():
    """Redundant everywhere: the energy drifts by less than 1e-8."""
    case = CASES["bricard"]
    assert run_case(ncgen.compile(case.build(), "c"), case, "lagrange", "dop853")["drift"] < 1e-8


def test_lengths_do_not_matter():
    """A pendulum of a micrometre and one of a thousand kilometres have the same relative error."""
    small, large = (
        run_case(ncgen.compile(CASES[name].build(), "c"), CASES[name], "lagrange", "rk4")["error"]
        for name in ("pendulum-1e-06", "pendulum-1e+06")
    )
    assert small == pytest.approx(large, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "formalism", "said"),
    [
        ("nfourbar-2", "coordinate-partitioning", "cannot continue beyond t = 0.71"),
        pytest.param("robot-sine", "coordinate-partitioning", "singular", marks=pytest.mark.slow),
    ],
)
def test_fails_in_words(name, formalism, said):
    """Where a method cannot go on it says when, or why it does not begin."""
    case = CASES[name]
    found = run_case(ncgen.compile(case.build(), "c"), case, formalism, "dop853")
    assert found["error"] is None
    assert said in found["reason"]


def test_a_run_that_takes_too_long_is_stopped():
    case = CASES["chain-100"]
    found = run_case(ncgen.compile(case.build(), "c"), case, "coordinate-partitioning", "bdf", limit=0.5)
    assert found["reason"] == "stopped after 0.5 s"


def test_the_free_body_s_reference():
    """Jacobi's functions as they are fitted here satisfy Euler's equations."""
    t = np.linspace(0.0, 10.0, 21)
    euler = solve_ivp(
        lambda t, w: -np.cross(w, PRINCIPAL * w) / PRINCIPAL, (0, 10), SPIN, method="DOP853", rtol=1e-13, atol=1e-13, t_eval=t
    )
    assert free_rotation(t) == pytest.approx(euler.y.T, abs=1e-11)


def test_the_command():
    """JSON records, one a method; an unknown case is refused by name."""
    done = CliRunner().invoke(app, ["hard", "--case", "violated", "--limit", "0.2", "--json"])
    records = json.loads(done.stdout)
    assert [(r["formalism"], r["integrator"]) for r in records] == methods()
    for r in records:
        assert (r["error"] is None) == (r["reason"] is not None)
        assert r["seconds"] > 0
    assert CliRunner().invoke(app, ["hard", "--case", "nothing"]).exit_code != 0


@pytest.mark.slow
def test_nothing_fails_in_silence():
    """The whole table: a finite error or a reason for every method in every case; a wrong branch is said.

    With a fixed step and order two a body that turns a thousand times is late by some hundredths; another branch is 2 away.
    """
    for record in hard_records(limit=5.0):
        assert (record["error"] is None) != (record["reason"] is None), record
        assert record["reason"] is None or "nothing said so" not in record["reason"], record
        allowed = 0.2 if record["case"] == "free-body" and record["integrator"] in FIXED else 1e-2
        assert record["error"] is None or record["error"] < allowed or record["warnings"], record
