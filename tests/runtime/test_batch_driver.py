"""Many states from C, without Python: under the sanitizers, in arrays that end where the last number ends."""

from __future__ import annotations

import subprocess

import pytest

import ncgen
from ncgen.emit.c.files import dynamics_files, model_files
from ncgen.emit.runtime_files import HEADERS, runtime_files
from ncgen.mechanism.batch_runs import SOURCES
from ncgen.mechanism.kernel_batch import SOURCES as KERNELS
from ncgen.solver.engines.partition_dynamics import dynamics
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.partition import choose_partitions

DRIVER = r"""
#include <stdio.h>
#include <stdlib.h>
#include "@.h"
#include "@_dynamics.h"
#include "ncgen_batch.h"
#include "ncgen_batch_run.h"

static const double start[] = {%(start)s}, parameters[] = {%(parameters)s 0.0};

static double *some(size_t count)
{
    return malloc(count * sizeof(double));
}

/* A workspace: it begins at a multiple of 64 bytes. */
static double *space(size_t count)
{
    void *block = NULL;
    return posix_memalign(&block, 64, count * sizeof(double)) ? NULL : block;
}

/* 1 unless all rows are equal to the last bit, and numbers. */
static int differ(const double *rows, long count, size_t width)
{
    for (long i = 0; i < count; ++i)
        for (size_t k = 0; k < width; ++k)
            if (!(rows[(size_t)i * width + k] == rows[k]))
                return 1;
    return 0;
}

/* Who ends a call at once. */
static long enough(void *context, double share)
{
    *(int *)context += 1;
    return share >= 0 && share <= 1 ? 0 : 1;
}

static int check(long count)
{
    const ncgen_model *model = @_model();
    const ncgen_dynamics *dynamics = @_dynamics();
    const ncgen_options options = {.method = NCGEN_DOPRI5, .tolerance = 1e-12, .rtol = 1e-6, .atol = 1e-8, .max_growth = 2.0};
    const size_t n = (size_t)model->n_coordinates, nz = (size_t)dynamics->n_independent, b = (size_t)count;
    const size_t m = (size_t)model->n_rows, np = (size_t)model->n_parameters;
    double *q = some(b * n), *qd = some(b * n), *zd = some(b * nz), *p = some(np), t[] = {0.0, 0.01};
    double *out = some(b * m), *out_q = some(b * n), *out_qd = some(b * n), *zdd = some(b * nz);
    double *rows_q = some(2 * b * n), *rows_qd = some(2 * b * n), *work = some(2 * b), *reached = some(b);
    double *kernel_space = space(ncgen_batch_workspace(model, (int)m)), *run_space = space(ncgen_batch_run_workspace(model, dynamics));
    int *status = malloc(b * sizeof(int)), wrong = 0;
    long *steps = malloc(b * sizeof(long));
    for (size_t i = 0; i < b * n; ++i) {
        q[i] = start[i %% n];
        qd[i] = 0.1;
    }
    for (size_t i = 0; i < b * nz; ++i)
        zd[i] = 0.1;
    for (size_t i = 0; i < np; ++i)
        p[i] = parameters[i];
    const ncgen_states states = {count, t, q, qd, p, 0, 0};
    wrong |= ncgen_batch_kernel(model, model->phi, NULL, &states, (int)m, out, 1, kernel_space) || differ(out, count, m);
    wrong |= ncgen_batch_kernel(model, NULL, model->gamma, &states, (int)m, out, 1, kernel_space) || differ(out, count, m);
    ncgen_batch_simulate(model, dynamics, &options, count, q, zd, p, 0, NULL, NULL, 2, t,
        rows_q, rows_qd, work, status, steps, reached, 1, run_space);
    wrong |= differ(rows_q, count, 2 * n) || differ(rows_qd, count, 2 * n) || differ(work, count, 2) || status[b - 1];
    int asked = 0;
    ncgen_options other = options;
    other.progress = enough, other.context = &asked, other.attempts_left = 1;
    wrong |= ncgen_batch_simulate(model, dynamics, &other, count, q, zd, p, 0, NULL, NULL, 2, t,
        rows_q, rows_qd, work, status, steps, reached, 1,
                                  run_space) != NCGEN_INTERRUPTED;
    wrong |= asked != 1 || status[0] != NCGEN_INTERRUPTED || status[b - 1] != NCGEN_INTERRUPTED || steps[b - 1] || reached[b - 1] > t[0];
    other = options;
    other.max_steps = 1, other.max_step = 1e-3;
    wrong |= ncgen_batch_simulate(model, dynamics, &other, count, q, zd, p, 0, NULL, NULL, 2, t,
        rows_q, rows_qd, work, status, steps, reached, 1,
                                  run_space) != NCGEN_OK;
    wrong |= steps[b - 1] != 1 || status[b - 1] != NCGEN_NOT_CONVERGED;
    other.method = NCGEN_RK4, other.max_step = 0;
    wrong |= ncgen_batch_simulate(model, dynamics, &other, count, q, zd, p, 0, NULL, NULL, 2, t,
        NULL, NULL, NULL, NULL, NULL, NULL, 1, run_space) !=
             NCGEN_ARGUMENT;
    ncgen_batch_accelerate(model, dynamics, &options, count, q, zd, p, 0, 0.0, out_q, out_qd, zdd, status, 1, run_space);
    wrong |= differ(out_q, count, n) || differ(out_qd, count, n) || differ(zdd, count, nz) || status[b - 1];
    ncgen_batch_accelerate(model, dynamics, &options, count, q, zd, p, 0, 0.0, q, NULL, zdd, status, 1, run_space);
    wrong |= differ(q, count, n) || differ(zdd, count, nz) || status[b - 1];
    double *const arrays[] = {q, qd, zd, p, out, out_q, out_qd, zdd, rows_q, rows_qd, work, reached, kernel_space, run_space};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; ++i)
        free(arrays[i]);
    free(status);
    free(steps);
    return wrong;
}

int main(void)
{
    for (long count = 1; count <= 2 * NCGEN_LANES + 1; ++count)
        if (check(count)) {
            printf("%%ld states\n", count);
            return 1;
        }
    return 0;
}
"""


@pytest.mark.parametrize(("model", "lanes"), [pytest.param("fourbar", 8, marks=pytest.mark.slow), ("andrews", 4)])
def test_many_states_within_their_arrays(model, lanes, tmp_path):
    """Rows shorter and longer than the lanes are many, full blocks and such that are not, in place and elsewhere."""
    kernels = ncgen.compile(ncgen.load(model), backend="c")
    q = assemble(kernels, kernels.q0)
    programs = dynamics(kernels, choose_partitions(kernels, q), "emitted", q, kernels.p0).written.programs
    files = model_files(kernels.programs) | dynamics_files(programs, kernels.programs.equations, kernels.row_sizes)
    files |= runtime_files(*HEADERS, *KERNELS, *SOURCES)
    files["main.c"] = DRIVER.replace("@", model) % {
        "start": ", ".join(map(repr, q.tolist())),
        "parameters": "".join(f"{x!r}, " for x in kernels.p0.tolist()),
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    sanitize = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", "-O0", "-Wno-psabi")
    sources = [name for name in files if name.endswith(".c")]
    command = ["gcc", "-std=gnu11", *sanitize, f"-DNCGEN_LANES={lanes}", "-include", "ncgen_lanes.h", *sources, "-o", "driver", "-lm"]
    built = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    done = subprocess.run(["./driver"], cwd=tmp_path, env={"ASAN_OPTIONS": "detect_leaks=1"}, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
