"""WebAssembly with a typed wrapper in JavaScript, in which the motion goes on."""

from __future__ import annotations

from collections.abc import Iterable

from ncgen.emit.environment import render
from ncgen.emit.wasm.files import module
from ncgen.exchange.export.package import Package
from ncgen.program.ir.blocks import Program

CONSTANTS = frozenset(
    "N ROWS ROW_SIZES START SPEEDS DEFAULTS KERNELS LARGEST T WORK POWER NEXT Q QD QDD LAM STATE EPSILON E NEWTON_STEPS PATIENCE "
    "MOST_STEPS LOCKED SINGULAR".split()
)
"""What the wrapper calls its constants: no class can be called so."""


def files(package: Package) -> dict[str, str | bytes]:
    """{file name: contents}."""
    prefix = package.prefix
    title = prefix[0].upper() + prefix[1:]
    binary, records = assembled(package, package.sources.programs.programs.values(), f"{title}_" if title in CONSTANTS else title)

    def filled(template: str) -> str:
        return render(f"package/wasm/{template}.jinja", **records)

    return {
        "README.md": filled("README.md"),
        "package.json": filled("package.json"),
        f"{prefix}.wasm": binary,
        f"{prefix}.js": filled("wrapper.js"),
        f"{prefix}.d.ts": filled("wrapper.d.ts"),
        "main.mjs": filled("main.mjs"),
    }


def assembled(package: Package, kernels: Iterable[Program], title: str) -> tuple[bytes, dict]:
    """(bytes of the module, what its wrapper is filled with): these kernels and the motion; title: of the wrapper's class."""
    kernels = list(kernels)
    switches = [package.switching.program] if package.switching else []
    programs = [*kernels, package.full.closing, package.full.motion, *package.outputs[:1], *switches]
    binary = module(programs, package.prefix)
    return binary, package.records | {
        "title": title,
        "kernel_shapes": [{"name": program.name, "inputs": program.inputs, "size": program.size} for program in kernels],
        "largest": max(program.size for program in programs),
        "size": len(binary),
    }
