"""Finding a C compiler, and what is asked of it.

Order: `$CC`, then cc, gcc and clang on the path, then the compiler of the Python package ziglang.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shlex
import shutil
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ncgen.errors import CompileError

FLAGS = ("-std=c99", "-O3", "-march=native", "-fno-tree-slp-vectorize", "-ffp-contract=fast", "-fPIC", "-shared")
"""No -ffast-math: sums keep their order. Fused multiply-adds, where the processor has them, halve the rounding error of the
robot's kernels and save a quarter of their time; the price is a last bit that depends on the processor."""


@dataclass(frozen=True)
class Compiler:
    """command: how to call it; identity: what tells one compiler on one processor from another."""

    command: tuple[str, ...]
    identity: str


def find_compiler() -> Compiler | None:
    """The first compiler found, or None. Raises CompileError if `$CC` names one that does not exist."""
    wanted = os.environ.get("CC", "")
    if wanted.strip():
        try:
            command = shlex.split(wanted)
        except ValueError as error:
            raise CompileError(f"CC={wanted}: {error}; correct CC or unset it") from None
        path = shutil.which(command[0])
        if path is None:
            raise CompileError(f"CC={wanted}: there is no such program; correct CC or unset it")
        path = str(Path(path).absolute())  # the compiler runs in another folder
        return Compiler((path, *command[1:]), _identity(path))
    for name in ("cc", "gcc", "clang"):
        if path := shutil.which(name):
            return Compiler((path,), _identity(path))
    if importlib.util.find_spec("ziglang"):
        return Compiler((sys.executable, "-m", "ziglang", "cc"), _identity(sys.executable))
    return None


def _identity(path: str) -> str:
    """The program file behind a name, by path, size and time of change, and the processor."""
    real = Path(path).resolve()
    status = real.stat()
    return f"{real}:{status.st_size}:{status.st_mtime_ns}:{_processor()}"


@cache
def _processor() -> str:
    """What -march=native depends on: a library built for one processor must not run on a lesser one."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return os.uname().machine if hasattr(os, "uname") else os.environ.get("PROCESSOR_IDENTIFIER", "")
    told = sorted({line for line in lines if line.startswith(("flags", "Features", "model name", "CPU part"))})
    return hashlib.sha256("\n".join(told).encode()).hexdigest()[:16]
