"""WebAssembly with a typed wrapper in JavaScript, in which the motion goes on."""

from __future__ import annotations

from ncgen.emit.environment import render
from ncgen.emit.wasm.files import module
from ncgen.exchange.export.package import Package


def files(package: Package) -> dict[str, str | bytes]:
    """{file name: contents}."""
    prefix, programs = package.prefix, package.sources.programs.programs
    motion = (package.full.closing, package.full.motion, *package.outputs[:1])
    binary = module([*programs.values(), *motion], prefix)
    records = package.records | {
        "title": prefix[0].upper() + prefix[1:],
        "largest": max(program.size for program in (*programs.values(), *motion)),
        "size": len(binary),
    }

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
