"""A Python package, compiled while it is installed."""

from __future__ import annotations

from ncgen.exchange.export.package import Package
from ncgen.exchange.export.python_package import python_files


def files(package: Package) -> dict[str, str]:
    """{path in the folder: text}."""
    return python_files(package, compiled=True)
