"""The measured figures of docs/studies.md: `python tests/studies/figures.py [NAME …] [--count N]`, NAME being a key of WAYS below."""

from __future__ import annotations

import argparse
import logging
import os
import pickle
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import ncgen
import ncgen.studies.design
import ncgen.studies.result
from ncgen.exchange.examples import example_module, load
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
    found, seconds = timed(model, vary, count, output=folder / "falls")
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
    ncgen.simulate(kernels, 0.5, p=p, **TOLERANCES)
    for _ in range(3):
        clock = time.perf_counter()
        ncgen.simulate(kernels, 0.5, p=p, **TOLERANCES)
        plain = time.perf_counter() - clock
        _, seconds = timed(model, vary, count)
        print(f"simulate rows {plain:.2f} s, study {seconds:.2f} s, of {count}")


def killed(folder: Path, count: int) -> None:
    """A Dask cluster of two of which a worker is killed every five seconds, in turns, whatever it does: nothing is lost, nothing comes
    twice, and bits are the same."""
    from distributed import LocalCluster

    model, vary = robot(folder)
    expected, alone = timed(model, vary, count)
    dead: list[int] = []
    over = threading.Event()
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL) as cluster:

        def kill() -> None:
            while not over.wait(5.0):
                nanny = list(cluster.workers.values())[len(dead) % 2]
                process = nanny.process and nanny.process.process
                if process and process.pid:
                    os.kill(process.pid, signal.SIGKILL)
                    dead.append(process.pid)

        killing = threading.Thread(target=kill, daemon=True)
        killing.start()
        found, seconds = timed(model, vary, count, output=folder / "killed", workers=cluster.scheduler_address)
        over.set()
        killing.join()
    same = all(np.array_equal(found[key], expected[key]) for key in expected.keys())
    once = np.array_equal(found.variant, np.arange(count))
    print(
        f"{count} in {seconds:.1f} s ({alone:.1f} s by threads), {len(dead)} workers killed; every variant once: {once}, same bits: {same}"
    )


def starting(folder: Path, count: int) -> None:
    """What a cluster's start consists of, in this process and in its workers."""
    from ncgen.studies.definition import Study
    from ncgen.studies.variants import Bench

    model, vary = robot(folder)
    bench = Bench(Study.of(model, vary, design="sobol", count=count, seed=1, keep=KEEP, simulation=TOLERANCES))
    sent = folder / "sent"
    sent.write_bytes(pickle.dumps((bench.study, bench.sample)))
    asked = "import time; a = time.perf_counter(); {}; print(time.perf_counter() - a)"
    bench_of = f"b = Bench(*pickle.loads(open({str(sent)!r}, 'rb').read())); b.computed(0, b.sample)"
    before = "import pickle; from ncgen.studies.variants import Bench; import ncgen.studies.engines; "
    for what, program in {
        "Python": "pass",
        "import distributed": asked.format("import distributed"),
        "import ncgen.studies.engines": asked.format("import ncgen.studies.engines"),
        "study read, choices made, first variants": before + asked.format(bench_of),
        "import scipy.stats.qmc, which workers do without": "import ncgen.studies.engines; " + asked.format("import scipy.stats.qmc"),
    }.items():
        clock = time.perf_counter()
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        print(f"{what}: {float(done.stdout or time.perf_counter() - clock):.2f} s")


LINKS = 3


def arm_in_mujoco(step: float) -> str:
    """The arm of the examples for MuJoCo: the frames of all links are the global ones at the start."""
    arm = example_module("arm")
    text, place = "", np.zeros(3)
    for i in range(LINKS):
        middle, tensor = arm.step(i) / 2, arm.inertia(i, LINKS)
        entries = [tensor[k] for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        text += f'<body pos="{row(place)}"><joint type="hinge" axis="{row(arm.axis(i))}"/>'
        text += f'<inertial pos="{row(middle)}" mass="{arm.mass(i, LINKS)!r}" fullinertia="{row(entries)}"/>'
        place = arm.step(i)
    options = f'<option gravity="0 0 -9.81" integrator="RK4" timestep="{step!r}"><flag contact="disable" constraint="disable"/></option>'
    return f'<mujoco><compiler balanceinertia="false"/>{options}<worldbody>{text}{"</body>" * LINKS}</worldbody></mujoco>'


def row(numbers: Any) -> str:
    return " ".join(repr(float(x)) for x in numbers)


def mujoco(folder: Path, count: int) -> None:
    """An open arm of three hinges falls for 0.5 s from other velocities: variants a second beside the largest error (rad), two threads;
    beside MuJoCo's rollout and, where it is installed, MJX (mujoco-mjx), which JAX compiles for many states, in double precision."""
    from mujoco import MjData, MjModel, rollout

    model = example_module("arm").build(LINKS)
    names = [f"psi{i + 1}" for i in range(LINKS)]
    vary = {f"start(rate({name}))": {"low": -1.0, "high": 1.0} for name in names}
    rates = ncgen.studies.design.Design.of(vary, "sobol", count, 1).rows(0, count)
    few = min(count, 256)

    def own(rtol: float, size: int) -> tuple[np.ndarray, float]:
        clock = time.perf_counter()
        found = ncgen.study(model, vary, design="sobol", count=size, seed=1, keep=names, duration=0.5, rtol=rtol, zd0={})
        return np.column_stack([found[name] for name in names]) - start, time.perf_counter() - clock

    kernels = ncgen.compile(model)
    start = np.array([kernels.q0[kernels.index[name]] for name in names])
    exact = own(1e-12, few)[0]

    def other(steps: int, size: int) -> tuple[np.ndarray, float]:
        made = MjModel.from_xml_string(arm_in_mujoco(0.5 / steps))
        data = [MjData(made) for _ in range(2)]
        states = np.column_stack([np.zeros((size, 1 + LINKS)), rates[:size]])
        clock = time.perf_counter()
        ends = []
        with rollout.Rollout(nthread=2) as engine:
            for first in range(0, size, 2000):  # what comes back has all steps in it
                state, _ = engine.rollout(made, data, states[first : first + 2000], nstep=steps)
                ends.append(state[:, -1, 1 : 1 + LINKS].copy())
        return np.concatenate(ends), time.perf_counter() - clock

    ways: list[tuple[str, Callable, tuple[float, ...]]] = [("ncgen, rtol", own, (1e-4, 1e-6, 1e-8))]
    ways.append(("MuJoCo, RK4, steps", other, (25, 50, 100, 200, 400)))
    if find_spec("mujoco.mjx"):
        ways.append(("MJX, RK4, steps", in_mjx(rates), (25, 50, 100)))
    for what, run, settings in ways:
        for setting in settings:
            run(setting, few)
            ends, seconds = run(setting, count)
            error = np.abs(ends[:few] - exact).max()
            print(f"{what} {setting:g}: {count / seconds:.0f} variants/s, error {error:.1e} rad")


def in_mjx(rates: np.ndarray) -> Callable[[int, int], tuple[np.ndarray, float]]:
    """What runs the arm in MJX; the first call of a number of states is compiled, so the time is that of a second one."""
    import jax
    from mujoco import MjModel, mjx

    jax.config.update("jax_enable_x64", True)

    def run(steps: int, size: int) -> tuple[np.ndarray, float]:
        made = mjx.put_model(MjModel.from_xml_string(arm_in_mujoco(0.5 / steps)))
        begin = mjx.make_data(made)

        def fall(rate: jax.Array) -> jax.Array:
            return jax.lax.fori_loop(0, steps, lambda _, data: mjx.step(made, data), begin.replace(qvel=rate)).qpos

        many = jax.jit(jax.vmap(fall))
        many(rates[:size]).block_until_ready()
        clock = time.perf_counter()
        ends = np.asarray(many(rates[:size]))
        return ends, time.perf_counter() - clock

    return run


WAYS = {
    "falls": (falls, 100_000),
    "single": (single, 500),
    "engines": (engines, 100_000),
    "bits": (bits, 20_000),
    "killed": (killed, 100_000),
    "starting": (starting, 1_000),
    "mujoco": (mujoco, 20_000),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=WAYS, nargs="*")
    parser.add_argument("--count", type=int)
    given = parser.parse_args()
    for what in given.transition or WAYS:
        function, usual = WAYS[what]
        folder = Path(tempfile.mkdtemp())
        print(f"-- {what}, load {os.getloadavg()[0]:.1f}", flush=True)
        try:
            function(folder, given.count or usual)
        finally:
            shutil.rmtree(folder)


if __name__ == "__main__":
    main()
