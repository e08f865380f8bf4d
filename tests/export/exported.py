"""Exports of five mechanisms made once a session, and the commands of their READMEs."""

from __future__ import annotations

import re
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen.exchange.examples import load

MODELS = ("pendulum", "robot", "nfourbar", "suspension", "cam")
SOME = ("pendulum", pytest.param("robot", marks=pytest.mark.slow), "nfourbar", "suspension", "cam")
"""The same, with the large one among the longer proofs."""

SECONDS = {"pendulum": 1.0, "robot": 0.5, "nfourbar": 0.6, "suspension": 0.5, "cam": 0.3}
STRICT = "-Wall -Wextra -Wpedantic -Wconversion -Wdouble-promotion -Wshadow -Werror"


def shell(command: str, folder: Path, **environment: str) -> str:
    """Run a command line in a folder; a failure shows what it said. Makefiles compile without optimising, in a third of the time, where the
    command does not say otherwise."""
    variables = {"PATH": "/usr/local/bin:/usr/bin:/bin", "HOME": str(folder), "CFLAGS": "-O0 -ffp-contract=off"} | environment
    done = subprocess.run(command, cwd=folder, env=variables, shell=True, capture_output=True, text=True)
    assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
    return done.stdout


def commands(readme: Path) -> list[list[str]]:
    """The blocks of commands in a README: paragraphs set in by four blanks."""
    blocks = re.findall(r"(?:^ {4}\S.*\n)+", readme.read_text(), re.MULTILINE)
    return [[line.strip() for line in block.splitlines()] for block in blocks]


@cache
def reference(name: str):
    """(kernels, trajectory) of our own run of the mechanism, at tight tolerance."""
    kernels = ncgen.compile(load(name))
    options = {k: v for k, v in kernels.model.simulation_options.items() if k in ("zd0", "z")}
    return kernels, ncgen.simulate(kernels, SECONDS[name], rtol=1e-11, atol=1e-12, points=11, **options)


def compare(csv: Path, name: str, tolerance: float) -> None:
    """A motion printed as CSV is that of our own run, column by column."""
    kernels, run = reference(name)
    header = csv.read_text().splitlines()[0].split(",")
    assert header == ["t", *kernels.coordinates, *(f"rate({c})" for c in kernels.coordinates)]
    table = np.loadtxt(csv, delimiter=",", skiprows=1)
    np.testing.assert_allclose(table, np.column_stack([run.t, run.q, run.qd]), rtol=tolerance, atol=tolerance)
