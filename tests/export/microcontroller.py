"""Exported C in single precision for a Cortex-M4 with its floating-point unit: compiled by zig, run by QEMU.

QEMU's user mode has no processor of the M profile; what is compiled for one is Thumb-2 code that a Cortex-A7 runs as well.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

from ncgen.exchange.examples import load
from ncgen.exchange.export import export

ZIG = f"{sys.executable} -m ziglang"
COMPILER = f"{ZIG} cc -target thumb-linux-musleabihf -mcpu=cortex_m4 -static"
EMULATOR = ("qemu-arm", "-cpu", "cortex-a7")


def missing() -> str:
    """What is not installed, or nothing."""
    programs = [program for program in ("make", "size", EMULATOR[0]) if not shutil.which(program)]
    return ", ".join(programs)


def build(name: str, folder: Path) -> dict[str, int]:
    """An export of an example in float, and its program `main`; {function: bytes that it takes of the stack, workspace and all}."""
    export(load(name), "c", folder)
    flags = "CFLAGS=-O1 -ffp-contract=off -Wframe-larger-than=0"
    command = ["make", "-s", "main", "NUMBER=SINGLE", f"CC={COMPILER}", f"AR={ZIG} ar", flags]
    said = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stderr
    return {name: int(size) for size, name in re.findall(r"stack frame size \((\d+)\) exceeds limit \(0\) in '(\w+)'", said)}


def run(folder: Path) -> str:
    """What the program prints: a table of the motion as CSV."""
    return subprocess.run([*EMULATOR, "./main"], cwd=folder, check=True, capture_output=True, text=True).stdout


def code(folder: Path) -> int:
    """Bytes of code and constants."""
    objects = sorted(str(path) for path in folder.glob("src/*.o"))
    lines = subprocess.run(["size", *objects], check=True, capture_output=True, text=True).stdout.splitlines()[1:]
    return sum(int(line.split()[0]) for line in lines)
