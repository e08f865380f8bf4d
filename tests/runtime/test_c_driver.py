"""The runtime from C, without Python: sanitizers and canaries, and every number type to its own precision."""

from __future__ import annotations

import subprocess
from itertools import product
from math import pi

import numpy as np
import pytest
from scipy.special import ellipk

import ncgen
from ncgen.emit.c.files import model_files, tangent_files
from ncgen.emit.runtime_files import runtime_files, runtime_names
from ncgen.mechanism.constrained_dynamics import ConstrainedDynamics
from ncgen.methods.table import FORMALISMS, INTEGRATORS, number_in_c
from ncgen.program.algebra.quasidefinite import Elimination
from ncgen.solver.positions.partition import choose_partitions

RUNTIME = runtime_names()
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror")
ELEMENTARY = {"sqrt", "pow", "sin", "cos", "exp", "log", "atan2", "floor"}
TYPES = {"float": "-DNCGEN_SINGLE", "double": "-DNCGEN_DOUBLE", "long double": "-DNCGEN_LONG_DOUBLE", "__float128": "-DNCGEN_QUAD"}

DRIVER = r"""
#include <stdio.h>
#include <stdlib.h>
#include "@.h"
#include "@_tangents.h"
#include "ncgen_runtime.h"

#define GUARD 32
#define CANARY ((ncgen_real)-12345.5L)

%(arrays)s

static int damaged = 0;

static ncgen_real *guarded(size_t size)
{
    ncgen_real *block = malloc((size + 2 * GUARD) * sizeof(ncgen_real));
    for (size_t i = 0; i < size + 2 * GUARD; ++i)
        block[i] = CANARY;
    return block + GUARD;
}

static void release(ncgen_real *array, size_t size)
{
    for (size_t i = 0; i < GUARD; ++i)
        damaged += !(array[size + i] >= CANARY && array[size + i] <= CANARY) ||
                   !(*(array - 1 - i) >= CANARY && *(array - 1 - i) <= CANARY);
    free(array - GUARD);
}

int main(int count, char **words)
{
    const ncgen_model *model = @_model();
    const size_t n = (size_t)model->n_coordinates, m = (size_t)model->n_rows;
    const ncgen_elimination elimination = {SIZE, NONZEROS, order, row_start, row_columns, row_positions, column_start,
                                           column_rows, entry_start, entry_columns, entry_values};
    ncgen_dynamics dynamics = {0};
    dynamics.column_sizes = column_sizes;
    dynamics.row_sizes = row_sizes;
    dynamics.elimination = &elimination;
    dynamics.singular_mass = SINGULAR_MASS;
    dynamics.conservative = count == 3;
    dynamics.n_independent = N_INDEPENDENT;
    dynamics.independent = independent;
    dynamics.dependent = dependent;
    dynamics.rows = rows_kept;
    dynamics.tangents = @_tangents();
    ncgen_options options = {0};
    options.formalism = count > 2 ? atoi(words[1]) : -1;
    options.method = count > 2 ? atoi(words[2]) : -1;
    if (options.method == NCGEN_ENERGY_MOMENTUM && count == 3)
        dynamics.tangents = NULL;
    dynamics.n_dependent = options.formalism == NCGEN_COORDINATE_PARTITIONING ? (int)n - N_INDEPENDENT : RANK;
    options.max_growth = (ncgen_scalar)1e9L;
    options.alpha_f = (ncgen_scalar)0.4L;
    options.alpha_m = (ncgen_scalar)0.3L;
    options.rtol = options.atol = (ncgen_scalar)TOLERANCE;
    options.max_step = (ncgen_scalar)STEP;
    options.tolerance = 10 * (ncgen_scalar)TOLERANCE;
    options.penalty = (ncgen_scalar)PENALTY;
    options.project = 1;
    const ncgen_scalar times[3] = {0, (ncgen_scalar)(DURATION / 2), (ncgen_scalar)DURATION};
    const size_t numbers = ncgen_workspace(model, &dynamics, &options);
    ncgen_real *q = guarded(n), *qd = guarded(n), *out_q = guarded(4 * n), *out_qd = guarded(4 * n), *work = guarded(4);
    ncgen_real *space = guarded(numbers), *p = guarded((size_t)model->n_parameters);
    const size_t count_of_integers = 4 * n + 3 * m;
    int *integers = malloc((count_of_integers + GUARD) * sizeof(int));
    for (size_t i = 0; i < GUARD; ++i)
        integers[count_of_integers + i] = GUARD;
    int rows = 0;
    ncgen_statistics statistics;
    for (size_t i = 0; i < n; ++i) {
        q[i] = model->initial_position[i];
        qd[i] = 0;
    }
    for (int i = 0; i < model->n_parameters; ++i)
        p[i] = model->default_parameters[i];
    const int status = ncgen_simulate(model, &dynamics, &options, p, q, qd, 3, times, out_q, out_qd, work, &rows,
                                      &statistics, space, integers);
    for (size_t i = 0; i < n; ++i) /* what differs from the nearest double, too */
        printf("%%.17g %%.17g\n", (double)out_q[2 * n + i], (double)(out_q[2 * n + i] - (ncgen_real)(double)out_q[2 * n + i]));
    release(q, n), release(qd, n), release(out_q, 4 * n), release(out_qd, 4 * n), release(work, 4);
    release(space, numbers), release(p, (size_t)model->n_parameters);
    for (size_t i = 0; i < GUARD; ++i)
        damaged += integers[count_of_integers + i] != GUARD;
    free(integers);
    fprintf(stderr, "status %%d rows %%d steps %%ld damaged %%d\n", status, rows, statistics.steps, damaged);
    return status || rows != 3 || damaged;
}
"""


def build_driver(kernels, folder, tolerance, duration, flags, step="0.0", rank=0) -> None:
    """Compile the driver for a mechanism that starts from rest; all warnings are errors."""
    dynamics = ConstrainedDynamics(kernels)
    arrays = [
        f"static const int {name}[] = {{{', '.join(map(str, getattr(dynamics.plan, name) or (0,)))}}};" for name in Elimination.ARRAYS
    ]
    part = choose_partitions(kernels, kernels.q0, 0.0, kernels.p0).position
    for name, positions in (("independent", part.independent), ("dependent", part.dependent), ("rows_kept", part.rows)):
        arrays.append(f"static const int {name}[] = {{{', '.join(map(str, positions))}}};")
    for name in ("row_sizes", "column_sizes"):
        arrays.append(
            f"static const ncgen_scalar {name}[] = {{{', '.join(f'(ncgen_scalar){x!r}' for x in getattr(kernels, name).tolist())}}};"
        )
    defines = {
        "SIZE": dynamics.plan.size, "NONZEROS": dynamics.plan.nonzeros,
        "TOLERANCE": tolerance, "DURATION": duration, "STEP": step, "RANK": rank, "PENALTY": "1e7",
        "SINGULAR_MASS": int(dynamics._dynamics.singular_mass), "N_INDEPENDENT": len(part.independent),
    }  # fmt: skip
    files = model_files(kernels.programs) | tangent_files(kernels.tangents.programs, kernels.programs.equations)
    files |= runtime_files(*RUNTIME)
    files["main.c"] = DRIVER.replace("@", kernels.name) % {"arrays": "\n".join(arrays)}
    for name, text in files.items():
        (folder / name).write_text(text)
    sources = [name for name in files if name.endswith(".c")]
    given = [f"-D{name}={value}" for name, value in defines.items()]
    libraries = ("-lquadmath", "-lm") if "-DNCGEN_QUAD" in flags else ("-lm",)
    command = ["gcc", *STRICT, *flags, *given, *sources, "-o", "driver", *libraries]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr


def run_driver(folder, formalism: str, method: str, *general: str) -> np.ndarray:
    """q at the end, as the nearest doubles and what is left; general: anything to take forces as if they had no potential."""
    command = ["./driver", str(number_in_c(FORMALISMS[formalism])), str(number_in_c(INTEGRATORS[method])), *general]
    done = subprocess.run(command, cwd=folder, env={"ASAN_OPTIONS": "detect_leaks=0"}, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return np.array([[float(x) for x in line.split()] for line in done.stdout.splitlines()])


ORDINARY = [name for name in FORMALISMS if name not in ("coordinate-partitioning", "ali3p")]
"""Those over all coordinates that any integrator takes."""


@pytest.fixture(scope="module")
def sanitized(tmp_path_factory):
    """Bricard's mechanism, with a redundant row and a singular mass matrix."""
    folder = tmp_path_factory.mktemp("sanitized")
    flags = ("-O0", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    build_driver(ncgen.compile(ncgen.load("bricard"), backend="c"), folder, "1e-8", "0.02", flags, step="0.01", rank=23)
    return folder


@pytest.mark.parametrize("general", [(), ("general",)], ids=["plain", "general"])
@pytest.mark.parametrize(("formalism", "method"), [
    *product((*ORDINARY, "coordinate-partitioning"), ("dopri5", "dop853", "rk4", "radau", "trapezoidal")),
    *(("lagrange", method) for method in ("rattle", "energy-momentum", "generalized-alpha")),
    ("ali3p", "trapezoidal"),
])  # fmt: skip
def test_within_its_workspace(sanitized, formalism, method, general):
    """Under the address and undefined-behaviour sanitizers, with canaries around everything that is written."""
    run_driver(sanitized, formalism, method, *general)


@pytest.mark.parametrize(("type_name", "method", "tolerance", "error"), [
    ("float", "dopri5", "1e-5L", 1e-4),
    ("double", "dop853", "1e-13L", 1e-11),
    pytest.param("long double", "dop853", "1e-16L", 1e-14, marks=pytest.mark.slow),
    ("__float128", "dop853", "1e-20L", 1e-17),
    pytest.param("float", "radau", "1e-5L", 1e-4, marks=pytest.mark.slow),
    pytest.param("long double", "radau", "1e-13L", 1e-12, marks=pytest.mark.slow),
    pytest.param("__float128", "radau", "1e-14L", 1e-13, marks=pytest.mark.slow),
])  # fmt: skip
def test_every_number_type_reaches_its_precision(type_name, method, tolerance, error, tmp_path):
    """A quarter of the pendulum's period, after which it hangs straight down: x = 0."""
    mpmath = pytest.importorskip("mpmath")
    kernels = ncgen.compile(ncgen.load("pendulum"), backend="c")
    with mpmath.workdps(40):
        quarter = mpmath.ellipk(mpmath.mpf(1) / 2) / mpmath.sqrt(mpmath.mpf(9.81))
        assert abs(quarter - ellipk(0.5) / np.sqrt(9.81)) < 1e-14 * pi
        text = mpmath.nstr(quarter, 19, min_fixed=-5) + "L"
    build_driver(kernels, tmp_path, tolerance, text, ("-O0", TYPES[type_name]))
    end = run_driver(tmp_path, "lagrange", method)
    assert abs(end[0].sum()) < error


@pytest.mark.parametrize(
    "compiler", [("gcc", *STRICT, TYPES["float"]), ("g++", "-x", "c++", "-std=c++11", *STRICT[1:])], ids=["float", "c++"]
)
def test_it_has_no_warning_in_float_and_in_cpp(tmp_path, compiler):
    """In float, where numbers are converted, and for those who embed it in a C++ project and compile all sources alike."""
    for name, text in runtime_files(*RUNTIME).items():
        (tmp_path / name).write_text(text)
    sources = [name for name in RUNTIME if name.endswith(".c")]
    done = subprocess.run([*compiler, "-fsyntax-only", *sources], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_no_state_and_no_calls_but_libm(tmp_path):
    """The runtime's objects have no writable data and need elementary functions and each other, nothing else."""
    for name, text in runtime_files(*RUNTIME).items():
        (tmp_path / name).write_text(text)
    sources = [name for name in RUNTIME if name.endswith(".c")]
    subprocess.run(["gcc", *STRICT, "-O0", "-fno-pic", "-fno-pie", "-c", *sources], cwd=tmp_path, check=True)
    objects = [f"{name[:-2]}.o" for name in sources]
    listed = subprocess.run(["nm", *objects], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    symbols = [line.split()[-2:] for line in listed.splitlines() if len(line.split()) >= 2]
    defined = {name for kind, name in symbols if kind in "TtRr"}
    assert {kind for kind, _ in symbols} <= set("TtRrU")
    assert {name for kind, name in symbols if kind == "U"} - defined <= ELEMENTARY
    assert all(name.startswith("ncgen_") for kind, name in symbols if kind == "T")
