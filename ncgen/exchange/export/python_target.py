"""A Python package of one mechanism, compiled while it is installed, with numpy and cffi below it."""

from __future__ import annotations

from ncgen.emit.environment import render
from ncgen.exchange.export.package import Package
from ncgen.toolchain.abi import marked

HAS_EVENTS = True


def files(package: Package) -> dict[str, str]:
    """{path in the folder: text}."""
    name = package.prefix.lower()
    records = package.records | {
        "package": name,
        "sources": [file for file in package.c if file.endswith(".c")],
        "cdef": marked(package.c[f"{package.prefix}_motion.h"]),
    }

    def filled(template: str) -> str:
        return render(f"package/python/{template}.jinja", **records)

    return {
        **{file: filled(file) for file in ("README.md", "pyproject.toml")},
        f"{name}/__init__.py": filled("init.py"),
        f"{name}/__main__.py": filled("main.py"),
        **{f"{name}/{module}.py": filled(f"{module}.py") for module in ("common", "compiled")},
        **{file: filled(file) for file in ("setup.py", "interface.py")},
        **{f"src/{file}": text for file, text in package.c.items()},
    }
