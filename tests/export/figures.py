"""The figures of docs/embedding.md: accuracy of exported C on the N-four-bar, size, time of the compiler and of a step;
sizes of pages, and on a microcontroller.

    python tests/export/figures.py

Errors are those of B0 at 10 s, after ten passes of the flat position, against the closed form with elliptic functions
(tests/export/test_c.py says which).
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

import microcontroller
import mpmath

from ncgen.exchange.examples import load
from ncgen.exchange.export import export

PROGRAM = r"""
#define _POSIX_C_SOURCE 200112L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "@_motion.h"
int main(int count, char **arguments)
{
    @_state s;
    @_real p[100];
    const double size = atof(arguments[2]), seconds = atof(arguments[3]);
    struct timespec a, b;
    int status = 0, steps = 0;
    (void)count;
    @_defaults(p);
    if (@_start(&s, p)) return 1;
    clock_gettime(CLOCK_MONOTONIC, &a);
    if (arguments[1][0] == 'a')
        status = @_advance(&s, p, seconds, size, size);
    else
        for (steps = 0; !status && steps < (int)(seconds / size + 0.5); ++steps) status = @_step(&s, p, size);
    clock_gettime(CLOCK_MONOTONIC, &b);
    printf("%.17g %.17g ", (double)s.q[0], (double)s.q[1]);
    printf("%g\n", ((b.tv_sec - a.tv_sec) * 1e6 + (b.tv_nsec - a.tv_nsec) * 1e-3) / (steps ? steps : 1));
    return status;
}
"""


def built(name: str, flags: str = "-O1 -ffp-contract=off") -> tuple[Path, float]:
    """The folder of an export with its library, and seconds of the processor that the compiler took."""
    folder = Path(tempfile.mkdtemp())
    export(load(name), "c", folder)
    (folder / "examples/main.c").write_text(PROGRAM.replace("@", name))
    before = os.times()
    subprocess.run(["make", "-s", f"CFLAGS={flags}", "main"], cwd=folder, check=True)
    after = os.times()
    return folder, after.children_user + after.children_system - before.children_user - before.children_system


def run(folder: Path, *arguments: object) -> list[float]:
    done = subprocess.run(["./main", *map(str, arguments)], cwd=folder, capture_output=True, text=True, check=True)
    return list(map(float, done.stdout.split()))


def accuracy() -> None:
    folder, _ = built("nfourbar")
    m = -4 * mpmath.mpf("9.81") * mpmath.mpf("3.5") / 3
    sn, cn = (mpmath.ellipfun(kind, 5, m=m) for kind in ("sn", "cn"))
    exact = float((2 * sn * cn).real), float((1 - 2 * sn**2).real)
    for way, sizes in (("advance", (1e-6, 1e-8, 1e-10, 1e-12)), ("step", (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4))):
        for size in sizes:
            x, y, _ = run(folder, way, size, 10.0)
            print(f"N-four-bar, {way} {size:g}: {max(abs(x - exact[0]), abs(y - exact[1])):.1e} m")


def sizes() -> None:
    for name in ("pendulum", "nfourbar", "suspension", "robot"):
        for flags in ("-O1 -ffp-contract=off", "-O1 -march=native -ffp-contract=off"):
            folder, seconds = built(name, flags)
            source = sum(f.stat().st_size for f in (*folder.glob("src/*.[ch]"), *folder.glob("include/*.h")))
            listed = subprocess.run(f"size lib{name}.a", cwd=folder, shell=True, capture_output=True, text=True, check=True).stdout
            code = sum(int(line.split()[0]) for line in listed.splitlines()[1:])
            step = min(run(folder, "step", 1e-3, 0.4)[2] for _ in range(15))
            print(f"{name}, {flags}: sources {source / 1e3:.0f} kB, code {code / 1e3:.0f} kB, compiler {seconds:.1f} s, step {step:.2f} µs")


def pages() -> None:
    for name in ("pendulum", "nfourbar", "suspension", "robot", "quadruped"):
        (page,) = export(load(name), "html", Path(tempfile.mkdtemp()))
        print(f"{name}: page {page.stat().st_size / 1000:.0f} kB")


def microcontrollers() -> None:
    if gone := microcontroller.missing():
        print(f"no figures of a microcontroller: {gone} not installed")
        return
    for name in ("pendulum", "nfourbar", "suspension", "robot"):
        folder = Path(tempfile.mkdtemp())
        stack = microcontroller.build(name, folder)[f"{name}_step"]
        code = microcontroller.code(folder)
        print(f"{name}, float, Cortex-M4: code {code / 1024:.0f} kB, stack of a step {stack / 1024:.1f} kB")


if __name__ == "__main__":
    accuracy()
    sizes()
    pages()
    microcontrollers()
