"""What the compiled code consists of: kernels and constants, nothing that is shared or changes."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from c_code import compile_object, tool

LIBM = {f"{name}{suffix}" for name in ("sin", "cos", "tan", "sqrt", "sincos", "pow", "exp", "log", "atan2") for suffix in ("", "f", "l")}
LINKER = {"_GLOBAL_OFFSET_TABLE_"}

# Calls every kernel with inputs that end where they should, and outputs between canaries.
GUARDED = r"""
#include <stdio.h>
#include <stdlib.h>
#include "robot.h"

#define GUARD 64
#define CANARY (-1.2345678e300)

static int failures = 0;

static double *filled(int size, double step)
{
    double *array = malloc((size_t)size * sizeof(double) + 1); /* never NULL */
    for (int i = 0; i < size; ++i)
        array[i] = step * (i % 7 - 3);
    return array;
}

static double *guarded(int size)
{
    double *block = malloc((size_t)(size + 2 * GUARD) * sizeof(double));
    for (int i = 0; i < size + 2 * GUARD; ++i)
        block[i] = CANARY;
    return block + GUARD;
}

static void check(const char *name, int status, double *out, int size)
{
    int wrong = status != NCGEN_OK;
    for (int i = 0; i < GUARD; ++i)
        wrong += out[-1 - i] != CANARY || out[size + i] != CANARY;
    for (int i = 0; i < size; ++i)
        wrong += out[i] == CANARY;
    printf("%s %d\n", name, size);
    failures += wrong;
    free(out - GUARD);
}

int main(void)
{
    const ncgen_model *m = robot_model();
    const int n = m->n_coordinates;
    double *q = filled(n, 0.125), *qd = filled(n, 0.5), *p = filled(m->n_parameters, 1.0), *out;
    for (int i = 0; i < n; ++i)
        q[i] += m->initial_position[i];
#define CALL(kernel, size, ...) out = guarded(size); check(#kernel, m->kernel(0.0, __VA_ARGS__, out), out, size)
    CALL(phi, m->n_rows, q, p);
    CALL(phi_q, m->phi_q_pattern.indptr[m->n_rows], q, p);
    CALL(gamma, m->n_rows, q, qd, p);
    CALL(mass, m->mass_pattern.indptr[n], q, p);
    CALL(force, n, q, qd, p);
    CALL(energy, 3, q, qd, p);
    CALL(constraints, 2 * m->n_rows + m->phi_q_pattern.indptr[m->n_rows], q, qd, p);
    free(q), free(qd), free(p);
    return failures;
}
"""


@pytest.fixture(scope="module", params=["unrolled", "tabled"])
def robot_object(request, robot_sources, tmp_path_factory):
    """The robot as position-dependent code, as an embedder may compile it."""
    return compile_object(robot_sources(request.param), tmp_path_factory.mktemp("object"), "-O1", "-fno-pic", "-fno-pie")


def symbols(object_file: Path, *options: str) -> set[str]:
    return {line.split()[-1] for line in tool("nm", *options, object_file.name, folder=object_file.parent).splitlines()}


def test_only_prefixed_symbols_are_visible(robot_object, robot_sources):
    """The getter and the kernels, and nothing else, can be seen from outside."""
    kernels = robot_sources("tabled").programs.programs
    assert symbols(robot_object, "-g", "--defined-only") == {"robot_model", *(f"robot_{name}" for name in kernels)}


def test_only_libm_is_needed(robot_object):
    """No allocation, no input or output: the code calls elementary functions and nothing else."""
    needed = symbols(robot_object, "-u")
    assert needed and needed <= LIBM | LINKER


def test_there_is_no_state(robot_object):
    """Nothing can be written to: the sections of variables are empty."""
    listed = tool("size", "-A", robot_object.name, folder=robot_object.parent)
    sizes = {name: int(size) for name, size in re.findall(r"^(\.\S+)\s+(\d+)", listed, re.MULTILINE)}
    assert sizes[".text"] > 0
    assert [name for name in sizes if re.match(r"\.(data|bss|tdata|tbss)", name) and sizes[name]] == []


def test_state_would_be_seen(tmp_path):
    """The check above finds a static variable, and one in a section of its own."""
    (tmp_path / "state.c").write_text("static int n; static double x = 1.0; double f(void); double f(void) { n++; return x += n; }\n")
    tool("gcc", "-fno-pic", "-c", "state.c", folder=tmp_path)
    with pytest.raises(AssertionError):
        test_there_is_no_state(tmp_path / "state.o")


@pytest.mark.parametrize("emission", ["unrolled", "tabled"])
def test_kernels_stay_within_their_arrays(robot_sources, emission, tmp_path):
    """Under the address and undefined-behaviour sanitizers, with canaries around outputs; every output is written."""
    sources = robot_sources(emission)
    sources.write(tmp_path)
    (tmp_path / "main.c").write_text(GUARDED)
    sanitize = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", "-O0")
    tool("gcc", "-std=c99", *sanitize, "robot.c", "main.c", "-o", "guarded", "-lm", folder=tmp_path)
    done = subprocess.run(["./guarded"], cwd=tmp_path, env={"ASAN_OPTIONS": "detect_leaks=0"}, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    sizes = {name: program.size for name, program in sources.programs.programs.items()}
    assert dict(line.split() for line in done.stdout.splitlines()) == {name: str(size) for name, size in sizes.items()}
