"""Radau's error estimate, called from C: after a rejection it is filtered once more (Hairer and Wanner, Solving ODEs II, IV.8)."""

from __future__ import annotations

import subprocess

import pytest

from ncgen.emit.runtime_files import needed_by, runtime_files

DRIVER = r"""
#include <stdio.h>
#include "ncgen_radau.c"

static int calls = 0;
static double asked = 0;

/* y' = 100 + y, one component; the linear system is x / 10 and the norm the size of its only component. */
static int derivative(ncgen_run *r, ncgen_scalar t, ncgen_real *y, ncgen_real *yd)
{
    (void)r, (void)t;
    calls += 1;
    asked = y[0];
    yd[0] = 100 + y[0];
    return NCGEN_OK;
}

void ncgen_shifted_solve(ncgen_run *r, const ncgen_implicit *m, const ncgen_shifted *shifted, const ncgen_real *f, ncgen_real *x)
{
    (void)r, (void)m, (void)shifted;
    x[0] = f[0] / 10;
}

ncgen_real ncgen_weighted_square(const ncgen_run *r, const ncgen_real *x, const ncgen_real *a, const ncgen_real *b)
{
    (void)r, (void)a, (void)b;
    return x[0] * x[0];
}

int main(void)
{
    double y[1] = {2}, slopes[1], new_y[1] = {2}, at[1], stages[3] = {0, 0, -3}, rates[3], right[1], change[1], error;
    int rejected;
    ncgen_run r = {0};
    ncgen_stepping w = {0};
    ncgen_implicit m = {0};
    if (scanf("%lf %d", &slopes[0], &rejected) != 2) return 9;
    r.ny = r.error_size = 1, r.y = y, r.derivative = derivative;
    w.stage_derivatives[0] = slopes, w.new_y = new_y, w.at = at;
    m.stages = stages, m.derivatives = rates, m.right = right, m.change = change;
    const int status = estimate(&r, &w, &m, 0.0, 0.5, rejected, &error);
    printf("%d %.17g %.17g\n", calls, asked, error);
    return status;
}
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The estimate with a derivative, a linear system and a norm of the test's own; the rest of the file is left out by the linker."""
    folder = tmp_path_factory.mktemp("radau")
    for name, text in runtime_files(*needed_by("ncgen_radau.c")).items():
        (folder / name).write_text(text)
    (folder / "main.c").write_text(DRIVER)
    alone, sources = ["-ffunction-sections", "-Wl,--gc-sections"], ["main.c", "ncgen_space.c", "ncgen_vectors.c"]
    subprocess.run(["cc", "-std=c99", "-O1", *alone, *sources, "-o", "main", "-lm"], cwd=folder, check=True)
    return folder / "main"


@pytest.mark.parametrize(
    ("slope", "rejected", "calls", "asked", "error"),
    [
        (18, 0, 0, 0, 2.0),  # the stages add 1/3 · 3 / 0.5 = 2 to the slope: (18 + 2) / 10
        (18, 1, 1, 4, 10.6),  # filtered: the slope at 2 + 2 is 104, and (104 + 2) / 10
        (3, 1, 0, 0, 0.5),
        (3, 0, 0, 0, 0.5),
    ],
    ids=["large at first", "large again", "small again", "small at first"],
)
def test_the_estimate(program, slope, rejected, calls, asked, error):
    done = subprocess.run([program], input=f"{slope} {rejected}", capture_output=True, text=True, check=True)
    assert list(map(float, done.stdout.split())) == pytest.approx([calls, asked, error], abs=1e-12)
