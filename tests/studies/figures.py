"""The measured figures of docs/studies.md: `python tests/studies/figures.py [falls | engines | bits | single] [--count N]`."""

from __future__ import annotations

import argparse
import re
import resource
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np

import ncgen
import ncgen.studies.design
import ncgen.studies.result
from ncgen.exchange.examples import load
from ncgen.exchange.toml_writer import to_toml

TOLERANCES = {"rtol": 1e-6, "atol": 1e-8}
SPREAD = 0.2
"""Masses of the eight bodies vary by a fifth to either side."""

KEEP = ("psi2", "psi3", "psi5", "rate(psi2)", "r8.z", "steps")


def robot(folder: Path) -> tuple[ncgen.Model, dict[str, dict[str, float]]]:
    """The paper's robot with its masses as parameters, from its own file, and how they vary."""
    text, masses = to_toml(load("robot")), {}

    def named(found: re.Match[str]) -> str:
        masses[f"mass{len(masses) + 2}"] = float(found[1])
        return f'mass = "mass{len(masses) + 1}"'

    text = re.sub(r"^mass = ([0-9.eE+-]+)$", named, text, flags=re.M)
    head, rest = text.split("\n[[", 1)
    parameters = "".join(f'\n[[parameter]]\nname = "{name}"\ndefault = {mass}\n' for name, mass in masses.items())
    path = folder / "robot.toml"
    path.write_text(f"{head}\n{parameters}\n[[{rest}", encoding="utf-8")
    vary = {name: {"low": (1 - SPREAD) * mass, "high": (1 + SPREAD) * mass} for name, mass in masses.items()}
    return ncgen.load(path), vary


def megabytes() -> float:
    """The most memory that this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def timed(model: ncgen.Model, vary: dict, count: int, **options: object) -> tuple[ncgen.studies.result.StudyResult, float]:
    clock = time.perf_counter()
    found = ncgen.study(model, vary, design="sobol", count=count, seed=1, keep=KEEP, **TOLERANCES, **options)
    return found, time.perf_counter() - clock


def falls(folder: Path, count: int) -> None:
    """Many falls in this process, with a folder: time, memory, and the rate."""
    model, vary = robot(folder)
    timed(model, vary, 64)
    found, seconds = timed(model, vary, count, folder=folder / "falls")
    size = sum(path.stat().st_size for path in (folder / "falls").iterdir()) / 1e6
    print(f"{count} falls, 2 threads: {seconds:.1f} s, {count / seconds:.0f} variants/s, {found.ok.sum()} arrived,", end=" ")
    print(f"{megabytes():.0f} MB of memory, {size:.1f} MB in {len(found._spans)} files")


def single(folder: Path, count: int) -> None:
    """A loop of `simulate` calls over the same variants."""
    model, vary = robot(folder)
    kernels = ncgen.compile(model)
    rows = ncgen.studies.design.Design.of(vary, "sobol", count, 1).rows(0, count)
    ways = {
        "simulate as it chooses": {},
        "simulate, lanes' method": {"formalism": "coordinate-partitioning", "integrator": "dopri5", "engine": "emitted"},
    }
    for way, options in ways.items():
        arguments = {"points": 2, **TOLERANCES, **options}
        ncgen.simulate(kernels, 0.5, **arguments)
        clock = time.perf_counter()
        for row in rows:
            ncgen.simulate(kernels, 0.5, p=dict(zip(vary, row, strict=True)), **arguments)
        seconds = time.perf_counter() - clock
        print(f"{way}: {count} calls, {seconds:.2f} s, {count / seconds:.0f} variants/s")


def engines(folder: Path, count: int) -> None:
    """The same study by threads, by processes and by Dask: the whole call, and the rate from a quarter of the variants on."""
    model, vary = robot(folder)
    timed(model, vary, 64)
    rates, found = {}, {}
    for name, options in {
        "2 threads": {"threads": 2},
        "2 processes": {"workers": 2},
        "LocalCluster of 2": {"workers": "local", "threads": 2},
    }.items():
        marks: list[tuple[float, int]] = []
        try:
            found[name], seconds = timed(
                model, vary, count, progress=lambda done, *_, marks=marks: marks.append((time.perf_counter(), done)), **options
            )
        except ncgen.NcgenError as error:
            print(f"{name}: {error}")
            continue
        begun = next(mark for mark in marks if mark[1] >= count / 4)
        ended = next(mark for mark in marks if mark[1] >= 0.95 * count)
        rates[name] = (ended[1] - begun[1]) / (ended[0] - begun[0])
        same = all(np.array_equal(found[name][key], found["2 threads"][key]) for key in found[name].keys())
        print(
            f"{name}: {count} in {seconds:.1f} s; {rates[name]:.0f} variants/s once begun, "
            f"{rates[name] / rates['2 threads']:.2f} of threads, same bits: {same}"
        )


def bits(folder: Path, count: int) -> None:
    """What it costs that bits are a variant's own: one choice of independent coordinates for all, against one a batch."""
    model, vary = robot(folder)
    timed(model, vary, count)
    kernels = ncgen.compile(model)
    rows = ncgen.studies.design.Design.of(vary, "sobol", count, 1).rows(0, count)
    p = dict(zip(vary, rows.T, strict=True))
    ncgen.simulate_batch(kernels, 0.5, p=p, **TOLERANCES)
    for _ in range(3):
        clock = time.perf_counter()
        ncgen.simulate_batch(kernels, 0.5, p=p, **TOLERANCES)
        plain = time.perf_counter() - clock
        _, seconds = timed(model, vary, count)
        print(f"simulate_batch {plain:.2f} s, study {seconds:.2f} s, of {count}")


WAYS = {"falls": (falls, 100_000), "single": (single, 500), "engines": (engines, 100_000), "bits": (bits, 20_000)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=WAYS, nargs="*")
    parser.add_argument("--count", type=int)
    given = parser.parse_args()
    for what in given.what or WAYS:
        function, usual = WAYS[what]
        folder = Path(tempfile.mkdtemp())
        try:
            function(folder, given.count or usual)
        finally:
            shutil.rmtree(folder)


if __name__ == "__main__":
    main()
