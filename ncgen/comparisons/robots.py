"""Robots from files, from the file to a second of motion: `ncgen bench robots`.

Every measurement of a file is a process of its own, which is ended when the file's time is over, so that no file keeps the others waiting.
MuJoCo and Pinocchio are given the same file without contacts, limits, dry friction and mimics; MuJoCo's error is against its own steps of
20 µs, ncgen's against its own run at a tight tolerance.
"""

from __future__ import annotations

import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import timeit
import warnings
import xml.etree.ElementTree as xml
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ncgen.comparisons.changed_robot import changed_copy
from ncgen.errors import ModelError, NcgenError, counted
from ncgen.exchange.robots import SUFFIXES

LIMIT = 120.0
"""Seconds that a file may take."""

RATE = 0.5
"""Joint velocities at the start, in turns positive and negative (rad/s, m/s): a robot that hangs at rest would not move."""

DURATIONS = (0.01, 0.1, 1.0)
"""Of runs (s), the next one after the one before has ended; the last one that ended is reported."""

RTOL, REFERENCE_RTOL = 1e-6, 1e-11
REPEATS, MOST_REPEATS, SHORT_RUN = 5, 100, 1e-3
"""Runs, of which the quickest counts, and as many of those that take less than so many seconds, whose first ones fill the caches."""

STEP, SMALL_STEP = 1e-3, 2e-5
"""MuJoCo's (s), and the one that its error is measured with."""

CALLS = 1000
"""Of Pinocchio's function in one measurement."""

FIRST = """
import json, os, sys, time
start = time.perf_counter()
import ncgen
kernels = ncgen.compile(ncgen.load(sys.argv[1]))
ncgen.simulate(kernels, 1e-3)
print(json.dumps({sys.argv[2]: time.perf_counter() - start, sys.argv[2] + "_processor": sum(os.times()[:4])}))
"""
"""What a user does first, with the import of ncgen and of what it needs, and the compiler."""

FIRSTS = ("cold", "cached", "changed")
"""Measurements of the first motion: with nothing cached, with all of it, and with all of it after one number of the file was changed."""

OPTIONAL = ("changed", "pinocchio", "mujoco")
"""Measurements without one of which the others go on."""

NUMBERS = {
    "dof": ("DOF", "{:d}"), "cold": ("cold, s", "{:.1f}"), "cached": ("cached, s", "{:.2f}"), "changed": ("changed, s", "{:.2f}"),
    "cold_processor": ("processor", "{:.1f}"), "evaluation": ("us each", "{:.2f}"), "aba": ("aba, us", "{:.2f}"),
    "ratio": ("ratio", "{:.2f}"), "evaluations": ("evaluations", "{:d}"), "seconds": ("1 s, ms", "{:.2f}"),
    "error": ("error", "{:.0e}"), "drift": ("energy", "{:.0e}"), "fallbacks": ("fallbacks", "{:.1%}"),
    "mujoco": ("MuJoCo, ms", "{:.2f}"), "mujoco_error": ("its error", "{:.0e}"),
}  # fmt: skip
"""{entry of a record: (title, how it is written)}."""

MILLISECONDS = ("seconds", "mujoco")


def robot_files(paths: Iterable[Path]) -> list[Path]:
    """The robots' files that are named or lie below the folders named, sorted. Raises ModelError where a path leads to none."""
    files: list[Path] = []
    for path in paths:
        inside = [path] if path.is_file() else sorted(file for file in path.rglob("*") if file.suffix.lower() in SUFFIXES)
        if not inside:
            raise ModelError(f"{path}: no such file, and no folder with files that end with {', '.join(SUFFIXES)}")
        files += inside
    if not files:
        raise ModelError("bench robots: name robots' files (URDF, MJCF, SDF), or folders that hold some")
    return files


def robot_records(files: Iterable[Path], limit: float = LIMIT) -> Iterator[dict]:
    """A record a file.

    file; dof: degrees of freedom; cold, cached, changed: seconds from the import of ncgen to the end of a first motion, as FIRSTS says;
    cold_processor: seconds of the processors in the first of these, the compiler's among them; duration (s) of the run; seconds of the
    processor that it took, evaluations, seconds an evaluation (evaluation), error (rad, m) at its end, drift of energy (relative),
    fallbacks (fraction of the evaluations); aba: seconds of Pinocchio's function, ratio of an evaluation to it; mujoco, mujoco_error:
    seconds and error (rad, m) of its run of 1 s. Unknown values are null; reason, changed_reason, pinocchio_reason,
    mujoco_reason: why, in a line.
    """
    for file in files:
        end = time.perf_counter() + limit
        record: dict[str, Any] = {"file": f"{file.parent.name}/{file.name}", "reason": None} | dict.fromkeys(NUMBERS)
        with tempfile.TemporaryDirectory() as folder:
            for stage in dict.fromkeys((*FIRSTS, "motion", *OPTIONAL)):
                measured_file = changed_copy(file, Path(folder)) if stage == "changed" else file
                if measured_file is None:
                    continue
                results, reason = _in_child(stage, measured_file, folder, end - time.perf_counter(), record.get("start", {}))
                record |= results | {f"{stage}_reason" if stage in OPTIONAL else "reason": reason}
                if record["reason"]:
                    break
        if record["evaluation"] and record["aba"]:
            record["ratio"] = record["evaluation"] / record["aba"]
        record.pop("start", None)
        yield record


def _in_child(stage: str, file: Path, folder: str, seconds: float, start: dict[str, float]) -> tuple[dict[str, Any], str | None]:
    """What one measurement printed up to its end or that of its time, and the reason why it did not come to its end."""
    script = FIRST if stage in FIRSTS else f"from ncgen.comparisons.robots import {stage}; {stage}()"
    command = [sys.executable, "-c", script, str(file), stage, json.dumps(start)]
    environment = os.environ | {"NCGEN_CACHE_DIR": folder, "OPENBLAS_NUM_THREADS": "1"}
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        child = subprocess.Popen(command, env=environment, stdout=out, stderr=err, start_new_session=True, text=True)
        try:
            reason = f"{stage} ended with {code}" if (code := child.wait(max(seconds, 0.1))) else None
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, signal.SIGKILL)  # the compiler, too
            child.wait()
            reason = f"the file's time was over in {stage}"
        for stream in (out, err):
            stream.seek(0)
        results: dict[str, Any] = {}
        for line in filter(lambda line: line.startswith("{"), out.read().splitlines()):
            results |= json.loads(line)
        messages = err.read().strip().splitlines()
    if reason and messages and "ended" in reason:
        reason = messages[-1].removeprefix("ncgen.errors.").replace(str(file), file.name)
    return results, reason


# -- what the processes do ---------------------------------------------------------------------------------------------


def motion() -> None:
    """A second of motion by the default call, then its error and its energy."""
    from ncgen.compiler import compile
    from ncgen.exchange.examples import load
    from ncgen.solver.motions.simulate import simulate_one
    from ncgen.solver.positions.rank import freedom

    warnings.simplefilter("ignore")
    kernels = compile(load(sys.argv[1]))
    names = kernels.model.chosen_independent
    zd0 = {name: RATE * (-1) ** i for i, name in enumerate(names)}
    _print_results(start=zd0, dof=len(names) or freedom(kernels).dof)
    duration, run = 0.0, None
    for duration in DURATIONS:
        seconds = np.inf
        for repeat in range(MOST_REPEATS):
            if repeat >= REPEATS and seconds > SHORT_RUN:
                break
            clock = time.process_time()
            once = simulate_one(kernels, duration, rtol=RTOL, zd0=zd0 or None, points=11)
            spent = min(time.process_time() - clock, once.statistics.seconds)  # neither preparation nor what others do to the processor
            run, seconds = (once, spent) if spent < seconds else (run, seconds)
            if once.statistics.seconds > 1.0:
                break
        assert run is not None
        counts = run.statistics
        fraction = counts.fallbacks / max(counts.evaluations, 1)
        _print_results(duration=duration, seconds=seconds, evaluations=counts.evaluations, fallbacks=fraction)
        _print_results(evaluation=seconds / max(counts.evaluations, 1))
    assert run is not None
    positions = [kernels.coordinates.index(name) for name in names] or list(range(kernels.n))
    with suppress(NcgenError):  # then the error is unknown, and the run counts all the same
        tight = simulate_one(kernels, duration, rtol=REFERENCE_RTOL, zd0=zd0 or None, points=2)
        _print_results(error=float(np.max(np.abs(run.q[-1] - tight.q[-1])[positions], initial=0.0)))
    _print_results(drift=float(run.energy_drift))


def pinocchio() -> None:
    """Its articulated-body algorithm, called from Python in random states."""
    pin = import_module("pinocchio")
    read = pin.buildModelFromMJCF if sys.argv[1].endswith(".xml") else pin.buildModelFromUrdf
    model = read(sys.argv[1])
    data, rng = model.createData(), np.random.default_rng(0)
    q, v, none = pin.integrate(model, pin.neutral(model), rng.uniform(-1, 1, model.nv)), rng.uniform(-1, 1, model.nv), np.zeros(model.nv)
    times = timeit.repeat(lambda: pin.aba(model, data, q, v, none), timer=time.process_time, number=CALLS, repeat=9)
    _print_results(aba=min(times) / CALLS)


def mujoco() -> None:
    """A second by implicitfast with steps of 1 ms, and its error."""
    mj = import_module("mujoco")
    mj.set_mju_user_warning(_unstable)  # else it writes a file
    model, start = _mujoco_model(mj, Path(sys.argv[1])), json.loads(sys.argv[3])
    flags = mj.mjtDisableBit
    model.opt.disableflags |= flags.mjDSBL_CONTACT | flags.mjDSBL_LIMIT | flags.mjDSBL_FRICTIONLOSS
    model.opt.integrator = mj.mjtIntegrator.mjINT_IMPLICITFAST
    joints = [j for j in range(model.njnt) if model.jnt_type[j] >= int(mj.mjtJoint.mjJNT_SLIDE)]
    ends, spent = {}, {}
    for step in (STEP, STEP, STEP, SMALL_STEP):
        data, model.opt.timestep = mj.MjData(model), step
        for j in joints:
            data.qvel[model.jnt_dofadr[j]] = start.get(model.joint(j).name, 0.0)
        clock = time.process_time()
        mj.mj_step(model, data, round(DURATIONS[-1] / step))
        spent[step] = min(time.process_time() - clock, spent.get(step, np.inf))
        ends[step] = data.qpos[[model.jnt_qposadr[j] for j in joints]]
        if step == STEP:
            _print_results(mujoco=spent[step])
    _print_results(mujoco_error=float(np.max(np.abs(ends[STEP] - ends[SMALL_STEP]), initial=0.0)))


def _mujoco_model(mj: Any, path: Path) -> Any:
    """A file as MuJoCo takes it; of URDF without shapes, whose meshes need not be there, and without mimics."""
    if path.suffix.lower() != ".urdf":
        return mj.MjModel.from_xml_path(str(path))
    root = xml.parse(path).getroot()
    for parent in [*root.iter("link"), *root.iter("joint")]:
        for child in [c for c in parent if c.tag in ("visual", "collision", "mimic")]:
            parent.remove(child)
    xml.SubElement(xml.SubElement(root, "mujoco"), "compiler", fusestatic="true", balanceinertia="true")
    return mj.MjModel.from_xml_string(xml.tostring(root, encoding="unicode"))


def _unstable(warning: str) -> None:
    raise NcgenError(f"MuJoCo: {warning}")


def _print_results(**results: Any) -> None:
    print(json.dumps(results), flush=True)


# -- for people --------------------------------------------------------------------------------------------------------


def line(cells: Sequence[str], name: str) -> str:
    """Cells below their titles, the file's name behind them."""
    return "  ".join(f"{cell:>{max(len(title), 7)}}" for cell, (title, _) in zip(cells, NUMBERS.values(), strict=True)) + "  " + name


def titles() -> str:
    return line([title for title, _ in NUMBERS.values()], "")


def robot_line(record: dict) -> str:
    """A record as a line."""
    reasons = [record[key] for key in ("reason", *(f"{stage}_reason" for stage in OPTIONAL)) if record.get(key)]
    short = f" ({record['duration']:g} s)" if record.get("duration", DURATIONS[-1]) < DURATIONS[-1] else ""
    return line([_cell(key, record[key]) for key in NUMBERS], ": ".join([record["file"] + short, *reasons]))


def _cell(key: str, value: float | None) -> str:
    if value is None:
        return ""
    size = 1e3 if key in MILLISECONDS else 1e6 if key in ("evaluation", "aba") else 1
    return NUMBERS[key][1].format(value if size == 1 else size * value)


def summary(records: list[dict]) -> Iterator[str]:
    """The median and the worst of every number, and how many files there were."""
    for key in NUMBERS:
        measured = [r for r in records if r[key] is not None and (key != "seconds" or r["duration"] == DURATIONS[-1])]
        known = [(r[key], r["file"]) for r in measured]
        if known and key != "dof":
            worst, name = max(known)
            median = statistics.median(value for value, _ in known)
            median = round(median) if isinstance(worst, int) else median
            yield f"{NUMBERS[key][0]:>12}: median {_cell(key, median)}, worst {_cell(key, worst)} ({name}) of {len(known)}"
    refused = sum(r["reason"] is not None for r in records)
    yield f"{counted(len(records), 'file')}, {refused} without a run to the end"
