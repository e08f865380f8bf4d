"""A Python package, in NumPy alone."""

from __future__ import annotations

from ncgen.exchange.export.package import Package
from ncgen.exchange.export.python_package import python_files


def files(package: Package) -> dict[str, str]:
    """{path in the folder: text}."""
    return python_files(package, compiled=False)
