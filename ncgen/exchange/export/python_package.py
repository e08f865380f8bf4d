"""A Python package of one mechanism with numpy below it, and cffi where it is compiled."""

from __future__ import annotations

from ncgen.emit.environment import render
from ncgen.emit.numpy.files import function_files
from ncgen.exchange.export.package import Package
from ncgen.toolchain.abi import marked


def python_files(package: Package, compiled: bool) -> dict[str, str]:
    """{path in the folder: text}; compiled: with the C sources, else in NumPy."""
    name = package.prefix.lower()
    records = package.records | {
        "package": name,
        "compiled": compiled,
        "sources": [file for file in package.c if file.endswith(".c")],
        "cdef": marked(package.c[f"{package.prefix}_motion.h"]),
        "holonomic": package.kernels.holonomic.tolist(),
        "W": package.sizes.W.tolist(),
        "V": package.sizes.V.tolist(),
    }

    def filled(template: str) -> str:
        return render(f"package/python/{template}.jinja", **records)

    files = {
        **{file: filled(file) for file in ("README.md", "pyproject.toml")},
        f"{name}/__init__.py": filled("init.py"),
        f"{name}/__main__.py": filled("main.py"),
        **{f"{name}/{module}.py": filled(f"{module}.py") for module in ("common", "compiled" if compiled else "pure")},
    }
    if not compiled:
        (kernels,) = package.sources.numpy.values()
        return files | {f"{name}/kernels.py": kernels} | _functions(package, name)
    sources = {f"src/{file}": text for file, text in package.c.items()}
    return files | {file: filled(file) for file in ("setup.py", "interface.py")} | sources


def _functions(package: Package, name: str) -> dict[str, str]:
    """{path: text} of what else a package in NumPy computes: the model's outputs, and when laws of time change their formula."""
    listed = {"outputs": package.outputs[:1], "switches": [package.switching.program] if package.switching else []}
    equations = package.sources.programs.equations
    return {
        f"{name}/{kind}.py": text
        for kind, programs in listed.items()
        if programs
        for text in function_files(programs, equations, kind).values()
    }
