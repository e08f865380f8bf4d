"""The runtime in WebAssembly, made once and kept in the package: with the generic kernels, for a mechanism that a table describes, and
alone, for the linked kernels of an exported mechanism, with events or without.

python -m ncgen.toolchain.generic_wasm      make the files anew from the sources, by the package ziglang
"""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from ncgen.emit.c.generic import generic_files
from ncgen.emit.runtime_files import (
    EXPLICIT_ONLY,
    FOLDER,
    HEADERS,
    RUNTIME_HEADERS,
    WITHOUT_PARTITIONING,
    WITHOUT_STEPPERS,
    WITHOUT_TABLES,
    needed_by,
    runtime_files,
    runtime_text,
)
from ncgen.files import write_bytes, write_text


class Module(NamedTuple):
    """A file of WebAssembly: the source that is called from outside, what else it needs, and flags of its own."""

    entry: str
    runtime: tuple[str, ...]
    others: Callable[[], dict[str, str]]
    flags: tuple[str, ...]

    @property
    def file(self) -> Path:
        return FOLDER / "generic" / f"{NAMES[self]}.wasm"


LINKED_MODEL = ("ncgen_linked_model.h", "ncgen_linked_model.c")
"""The description of linked kernels."""

GENERIC = Module("ncgen_table_run", ("ncgen_driven.c",), generic_files, ("-O2",))
LINKED = Module(
    "ncgen_linked",
    ("ncgen_breaks.c", "ncgen_events.c"),
    lambda: runtime_files(*HEADERS, *LINKED_MODEL),
    ("-Os", "-Wl,--export-table", "-Wl,--growable-table", "-Wl,--export=__heap_base"),
)
WITHOUT_EVENTS = LINKED._replace(
    runtime=("ncgen_breaks.c",), others=lambda: runtime_files(*HEADERS, *LINKED_MODEL, "ncgen_held.h", "ncgen_modes.h", "ncgen_no_events.c")
)
"""For mechanisms without events, which do without a third of the module."""

NAMES = {GENERIC: "ncgen_generic", LINKED: "ncgen_linked", WITHOUT_EVENTS: "ncgen_linked_plain"}

FILE = GENERIC.file

COMPILER = "0.17.1"
"""The version of ziglang that made the files; another one may write other bytes."""

MACROS = (EXPLICIT_ONLY, WITHOUT_PARTITIONING, WITHOUT_STEPPERS, WITHOUT_TABLES)

FLAGS = ("-std=c99", "-g0", "-target", "wasm32-wasi", "-mexec-model=reactor", "-ffp-contract=off", "-Wl,--strip-all")


def sources(module: Module = GENERIC) -> dict[str, str]:
    """{file name: text} of all that is compiled."""
    runtime = needed_by(*module.runtime, defined=MACROS)
    headers = tuple(name for name in RUNTIME_HEADERS if name not in runtime)
    entry = (f"{module.entry}.h", f"{module.entry}.c")
    return module.others() | runtime_files(*runtime, *headers, *entry, defined=MACROS)


def exported(module: Module = GENERIC) -> list[str]:
    """The functions that are called from outside."""
    return re.findall(rf"\b({module.entry.removesuffix('_run')}_\w+)\(", runtime_text(f"{module.entry}.h").split("begin functions")[1])


def digest() -> bytes:
    """What the sources of the files, the compiler and its flags are, in 32 bytes that the files end with."""
    texts = [COMPILER, *FLAGS, *MACROS]
    for module in NAMES:
        texts += [*module.flags, *(text for pair in sorted(sources(module).items()) for text in pair)]
    return hashlib.sha256("\0".join(texts).encode()).digest()


def section(payload: bytes) -> bytes:
    """A custom section, which engines pass over, of less than 120 bytes."""
    name = b"sources"
    content = bytes([len(name)]) + name + payload
    return bytes([0, len(content)]) + content


def built(module: Module = GENERIC) -> bytes:
    """A file as the sources give it."""
    with tempfile.TemporaryDirectory() as folder:
        texts = sources(module)
        for name, text in texts.items():
            write_text(Path(folder) / name, text)
        names = [name for name in texts if name.endswith(".c")]
        exports = [f"-Wl,--export={name}" for name in sorted(set(exported(module)))]
        defined = [f"-D{macro}" for macro in MACROS]
        command = [sys.executable, "-m", "ziglang", "cc", *FLAGS, *module.flags, *defined, *exports, *names, "-o", "made.wasm"]
        subprocess.run(command, cwd=folder, check=True)
        return (Path(folder) / "made.wasm").read_bytes() + section(digest())


def binary(module: Module = GENERIC) -> bytes:
    """A file that the package has."""
    return module.file.read_bytes()


if __name__ == "__main__":
    for made in NAMES:
        write_bytes(made.file, built(made))
        print(f"{made.file}: {made.file.stat().st_size} bytes")
