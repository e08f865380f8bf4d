"""Instructions of kernels by valgrind's callgrind: counts that repeat to the digit, whatever else the machine does.

They depend on the compiler and on the C library's sine and cosine, so they are compared on one system.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ncgen.comparisons.rivals.base import KERNELS, Inputs, own_start
from ncgen.comparisons.rivals.handwritten import source
from ncgen.compiler import compile, generate
from ncgen.emit.c.files import motion_files
from ncgen.emit.naming import prefix_of
from ncgen.emit.runtime_files import HEADERS, RUNTIME_HEADERS, runtime_files
from ncgen.errors import NcgenError
from ncgen.mechanism.library import CompiledKernels
from ncgen.model import Model
from ncgen.program.ir.cost import cost
from ncgen.program.motions.dynamics import assemble_motion
from ncgen.program.programs import EMISSIONS
from ncgen.solver.engines.acceleration_forms import own_positions
from ncgen.solver.engines.capabilities import is_emitted
from ncgen.solver.engines.partition_dynamics import dynamics
from ncgen.toolchain.cache import compiled
from ncgen.toolchain.compilers import FLAGS, find_compiler

TIMES = 1000
"""As in count.c."""

COMMON = "x86-64-v3"
"""What valgrind can run: it knows no AVX-512."""


def instruction_records(model: Model) -> Iterator[dict]:
    """Records of case (the kernel), tool and instructions of one call. Raises NcgenError where valgrind or a compiler is missing."""
    require_valgrind()
    kernels = compile(model, "c")
    inputs = Inputs.typical(kernels)
    prefix = prefix_of(model.name)
    with tempfile.TemporaryDirectory() as folder:
        count = _Counter(Path(folder), _flags())
        for way in EMISSIONS:
            sources = generate(model, way)
            for name, program in sources.programs.programs.items():
                kind = "velocity" if "qd" in program.inputs else "position"
                numbers = inputs.q, inputs.qd, inputs.p, program.size
                yield _record(name, f"generated, {way}", count(sources.c, f"{prefix}_{name}", kind, numbers))
        if path := source(kernels):
            for name in KERNELS:
                kind, size = "velocity" if name == "gamma" else "position", kernels.programs.programs[name].size
                numbers = inputs.q, inputs.qd, inputs.p, size
                yield _record(name, "hand-written", count({path.name: path.read_text("utf-8")}, f"handwritten_{name}", kind, numbers))
        yield from _derivative_records(kernels, count)


def require_valgrind() -> None:
    """Raises NcgenError where it is not there."""
    if shutil.which("valgrind") is None:
        raise NcgenError("instructions are counted by valgrind, which is not there; install it (Debian: apt install valgrind)")


def counted_by_valgrind(name: str, command: Sequence[str | Path], **options: Any) -> int:
    """Instructions of a program, called with what follows valgrind's own words; options: of `subprocess.run`. Raises NcgenError."""
    require_valgrind()
    valgrind = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]
    done = subprocess.run([*valgrind, *command], capture_output=True, text=True, **options)
    collected = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode or not collected:
        raise NcgenError(f"{name}: valgrind does not count it: {done.stderr.strip().splitlines()[-1]}")
    return int(collected[1])


def derivative_of_all(model: Model) -> tuple[int, float]:
    """Operations and instructions of a state derivative over all coordinates. Raises NcgenError where none is emitted."""
    kernels = compile(model, "c")
    if (seen := own_positions(kernels)) is None:
        raise NcgenError(f"{model.name}: no state derivative over all coordinates is emitted; take a smaller model")
    programs = assemble_motion(kernels.programs.equations, *seen, kernels.column_sizes)
    files = motion_files(programs, kernels.programs.equations) | runtime_files(*RUNTIME_HEADERS, *HEADERS)
    prefix, (q, _) = prefix_of(kernels.name), own_start(kernels)
    with tempfile.TemporaryDirectory() as folder:
        count = _Counter(Path(folder), _flags())
        numbers = q, np.zeros(kernels.n), kernels.p0, programs.derivative.size
        counted = count(files, f"{prefix}_recursion", "derivative", numbers, f"{prefix}_derivative")
    return cost(programs.derivative).total, counted


def _flags() -> tuple[str, ...]:
    return tuple(f"-march={COMMON}" if flag.startswith("-march") else flag for flag in FLAGS)


def _derivative_records(kernels: CompiledKernels, count: _Counter) -> Iterator[dict]:
    """The two functions of the emitted state derivative, at a closed position."""
    q, partitions = own_start(kernels)
    if not kernels.m or not is_emitted(kernels, partitions):
        return
    written = dynamics(kernels, partitions, "emitted", q, kernels.p0).written
    programs, files = written.programs, written.files
    files = files | runtime_files(*RUNTIME_HEADERS, *HEADERS)
    prefix, zd = prefix_of(kernels.name), np.ones(len(partitions.velocity.independent))
    for kind, program in (("newton", programs.newton), ("acceleration", programs.acceleration)):
        numbers = q, zd, kernels.p0, program.size
        yield _record(kind, "state derivative", count(files, f"{prefix}_dynamics", kind, numbers, f"{prefix}_{kind}"))


class _Counter:
    """The program that calls a function of a library, and valgrind around it."""

    def __init__(self, folder: Path, flags: tuple[str, ...]) -> None:
        self.flags, self.program = flags, folder / "count"
        for name, text in runtime_files(*RUNTIME_HEADERS, *HEADERS).items():
            (folder / name).write_text(text, encoding="utf-8")
        shutil.copy(Path(__file__).with_name("count.c"), folder)
        if (compiler := find_compiler()) is None:
            raise NcgenError("the program that calls kernels cannot be compiled: there is no C compiler; install one")
        command = [*compiler.command, "-std=gnu99", "-O1", "count.c", "-o", "count", "-ldl", "-lm"]
        made = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        if made.returncode:
            raise NcgenError(f"the program that calls kernels does not compile: {made.stderr.strip().splitlines()[0]}")

    def __call__(
        self, files: dict[str, str], function: str, kind: str, numbers: tuple[np.ndarray, np.ndarray, np.ndarray, int], counted: str = ""
    ) -> float:
        """Instructions of one call; counted: the function's own name where `function` returns a table of them."""
        library = compiled(files, self.flags).library
        q, v, p, size = numbers
        given = " ".join([f"{len(q)} {len(v)} {len(p)} {size}", *(repr(float(x)) for a in (q, v, p) for x in a)])
        command = [f"--toggle-collect={counted or function}", self.program, library, function, kind]
        return counted_by_valgrind(function, command, input=given) / TIMES


def _record(case: str, tool: str, instructions: float) -> dict:
    return {"case": case, "tool": tool, "instructions": instructions}


def table(records: list[dict]) -> list[tuple[str, ...]]:
    """A line a tool, a column a kernel, titles first."""
    cases = list(dict.fromkeys(r["case"] for r in records))
    known = {(r["tool"], r["case"]): f"{r['instructions']:.0f}" for r in records}
    tools = dict.fromkeys(r["tool"] for r in records)
    return [("instructions", *cases), *((tool, *(known.get((tool, case), "") for case in cases)) for tool in tools)]
