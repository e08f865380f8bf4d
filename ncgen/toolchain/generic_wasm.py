"""The generic kernels and the runtime as one WebAssembly file, which takes a mechanism as a table; made once and kept in the package.

python -m ncgen.toolchain.generic_wasm      make it anew from the sources, by the package ziglang
"""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from ncgen.emit.c.generic import generic_files
from ncgen.emit.runtime import (
    EXPLICIT_ONLY,
    FOLDER,
    RUNTIME_HEADERS,
    WITHOUT_PARTITIONING,
    WITHOUT_STEPPERS,
    WITHOUT_TABLES,
    needed_by,
    runtime_files,
    runtime_text,
)
from ncgen.files import write_bytes, write_text

FILE = FOLDER / "generic" / "ncgen_generic.wasm"

COMPILER = "0.17.1"
"""The version of ziglang that made the file; another one may write other bytes."""

MACROS = (EXPLICIT_ONLY, WITHOUT_PARTITIONING, WITHOUT_STEPPERS, WITHOUT_TABLES)

FLAGS = ("-std=c99", "-O2", "-g0", "-target", "wasm32-wasi", "-mexec-model=reactor", "-ffp-contract=off", "-Wl,--strip-all")


def sources() -> dict[str, str]:
    """{file name: text} of all that is compiled."""
    runtime = needed_by("ncgen_driven.c", defined=MACROS)
    headers = tuple(name for name in RUNTIME_HEADERS if name not in runtime)
    table_run = ("ncgen_table_run.h", "ncgen_table_run.c")
    return generic_files() | runtime_files(*runtime, *headers, *table_run, defined=MACROS)


def exported() -> list[str]:
    """The functions that a page calls."""
    return re.findall(r"\b(ncgen_table_\w+)\(", runtime_text("ncgen_table_run.h").split("begin functions")[1])


def digest() -> bytes:
    """What the sources, the compiler and its flags are, in 32 bytes that the file ends with."""
    texts = [COMPILER, *FLAGS, *MACROS, *(part for pair in sorted(sources().items()) for part in pair)]
    return hashlib.sha256("\0".join(texts).encode()).digest()


def section(payload: bytes) -> bytes:
    """A custom section, which engines pass over, of less than 120 bytes."""
    name = b"sources"
    content = bytes([len(name)]) + name + payload
    return bytes([0, len(content)]) + content


def built() -> bytes:
    """The file as the sources give it."""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in sources().items():
            write_text(Path(folder) / name, text)
        names = [name for name in sources() if name.endswith(".c")]
        exports = [f"-Wl,--export={name}" for name in sorted(set(exported()))]
        defined = [f"-D{macro}" for macro in MACROS]
        command = [sys.executable, "-m", "ziglang", "cc", *FLAGS, *defined, *exports, *names, "-o", "generic.wasm"]
        subprocess.run(command, cwd=folder, check=True)
        return (Path(folder) / "generic.wasm").read_bytes() + section(digest())


def binary() -> bytes:
    """The file that the package has."""
    return FILE.read_bytes()


if __name__ == "__main__":
    write_bytes(FILE, built())
    print(f"{FILE}: {FILE.stat().st_size} bytes")
