"""Compiling emitted C by hand, strictly, and running it without any of ncgen's own loading."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np

import ncgen
from ncgen.emit.naming import prefix_of

WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror")
C99 = ("-std=c99", *WARNINGS)
CPP98 = ("-std=c++98", *WARNINGS)


# C99 and C++98 alike: prints what the descriptor holds, and calls every kernel at MOVE steps from the initial position.
CONSUMER = r"""
#include <stdio.h>
#include "@.h"

#ifndef MOVE
#define MOVE 1
#endif

static ncgen_real q[1000], qd[1000], p[1000], out[2000];

static int show(const char *name, int status, int size)
{
    for (int i = 0; i < size; ++i)
        printf("%s %.17g\n", name, (double)out[i]);
    return status;
}

int main(void)
{
    const ncgen_model *m = @_model();
    const ncgen_real t = (ncgen_real)3 / 8;
    int bad = 0;
    for (int i = 0; i < m->n_coordinates; ++i) {
        out[i] = m->initial_position[i];
        q[i] = out[i] + (ncgen_real)(MOVE * (i % 7 - 3)) / 64;
        qd[i] = (ncgen_real)(i % 5 - 2) / 2;
    }
    bad |= show("q0", 0, m->n_coordinates);
    for (int i = 0; i < m->n_parameters; ++i)
        out[i] = p[i] = m->default_parameters[i];
    bad |= show("p0", 0, m->n_parameters);
    if (m->phi) bad |= show("phi", m->phi(t, q, p, out), m->n_rows);
    if (m->phi_q) bad |= show("phi_q", m->phi_q(t, q, p, out), m->phi_q_pattern.indptr[m->n_rows]);
    if (m->nu) bad |= show("nu", m->nu(t, q, p, out), m->n_rows);
    if (m->gamma) bad |= show("gamma", m->gamma(t, q, qd, p, out), m->n_rows);
    if (m->mass) bad |= show("mass", m->mass(t, q, p, out), m->mass_pattern.indptr[m->n_coordinates]);
    if (m->force) bad |= show("force", m->force(t, q, qd, p, out), m->n_coordinates);
    if (m->energy) bad |= show("energy", m->energy(t, q, qd, p, out), 3);
    if (m->power) bad |= show("power", m->power(t, q, qd, p, out), 1);
    if (m->constraints)
        bad |= show("constraints", m->constraints(t, q, qd, p, out), 2 * m->n_rows + m->phi_q_pattern.indptr[m->n_rows]);
    return bad;
}
"""


def tool(*command, folder: Path) -> str:
    """Run a tool in a folder; a failure shows the command and what it said."""
    done = subprocess.run(list(map(str, command)), cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}"
    return done.stdout


def compilers() -> list[str]:
    """The C compilers of this machine that understand GCC's options."""
    return [name for name in ("gcc", "clang") if shutil.which(name)]


def compile_object(sources, folder: Path, *flags: str, compiler: str = "gcc") -> Path:
    """The object file of a model's C source, all warnings being errors."""
    sources.write(folder)
    name = prefix_of(sources.programs.equations.model.name)
    tool(compiler, *C99, *flags, "-c", f"{name}.c", "-o", f"{name}.o", folder=folder)
    return folder / f"{name}.o"


def run_consumer(object_file: Path, *flags: str, compiler: str = "gcc") -> dict[str, np.ndarray]:
    """Compile the consumer, link it to a model's object and return {kernel, q0 or p0: numbers}."""
    folder, prefix = object_file.parent, object_file.stem
    text, plus = CONSUMER.replace("@", prefix), "++" in compiler
    source = folder / f"consumer.{'cpp' if plus else 'c'}"
    source.write_text(text)
    tool(compiler, *(CPP98 if plus else C99), *flags, "-c", source.name, "-o", "consumer.o", folder=folder)
    libraries = ("-lquadmath", "-lm") if "-DNCGEN_QUAD" in flags else ("-lm",)
    tool(compiler, *flags, "consumer.o", object_file.name, "-o", "consumer", *libraries, folder=folder)
    said: dict[str, list[float]] = {}
    for line in tool("./consumer", folder=folder).splitlines():
        kernel, value = line.split()
        said.setdefault(kernel, []).append(float(value))
    return {kernel: np.array(values) for kernel, values in said.items()}


def run_numpy(sources) -> dict[str, np.ndarray]:
    """What the NumPy module computes where the consumer does."""
    kernels = ncgen.compile(sources, backend="numpy")
    i = np.arange(kernels.n)
    q, qd, t = kernels.q0 + (i % 7 - 3) / 64, (i % 5 - 2) / 2, 3 / 8
    said = {name: kernels.values(name, t, q, qd, None) for name in sources.programs.programs} | {"q0": kernels.q0, "p0": kernels.p0}
    return {name: values for name, values in said.items() if len(values)}
