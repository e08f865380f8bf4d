"""WebAssembly with a typed wrapper in JavaScript, compiled by the zig of the Python package ziglang."""

from __future__ import annotations

import importlib.util

from ncgen.emit.environment import render
from ncgen.errors import CompileError
from ncgen.exchange.export.package import Package, renamed
from ncgen.toolchain.cache import build
from ncgen.toolchain.compilers import zig

FLAGS = (
    "-target",
    "wasm32-wasi",
    "-mexec-model=reactor",
    "-std=c99",
    "-O2",
    "-ffp-contract=off",
    "-s",
    "-fno-stack-protector",
    "-Wl,-z,stack-size=1048576",
)
ROOM = ("state", "p", "out", "energies")
MOTION = ("defaults", "start", "settle", "step", "advance", "message")


def files(package: Package) -> dict[str, str | bytes]:
    """{file name: contents}. Raises CompileError without ziglang."""
    prefix, programs = package.prefix, package.sources.programs.programs
    records = package.records | {
        "title": prefix[0].upper() + prefix[1:],
        "largest": max([2, *(program.size for program in programs.values())]),
    }

    def filled(template: str, **more: int) -> str:
        return renamed(render(f"package/wasm/{template}.jinja", **records, **more), prefix)

    seen = [*(f"{prefix}_{name}" for name in (*programs, *MOTION)), *(f"{prefix}_wasm_{name}" for name in ROOM)]
    binary = _compiled(package.c | {"wasm.c": filled("wasm.c")}, seen)
    return {
        "README.md": filled("README.md", size=len(binary)),
        "package.json": filled("package.json"),
        f"{prefix}.wasm": binary,
        f"{prefix}.js": filled("wrapper.js"),
        f"{prefix}.d.ts": filled("wrapper.d.ts"),
        "main.mjs": filled("main.mjs"),
    }


def _compiled(sources: dict[str, str], seen: list[str]) -> bytes:
    if importlib.util.find_spec("ziglang") is None:
        raise CompileError("WebAssembly is compiled by the package ziglang, which is missing; run pip install 'ncgen[export]'")
    return build(sources, zig(), (*FLAGS, *(f"-Wl,--export={name}" for name in seen)), loads=False).library.read_bytes()
