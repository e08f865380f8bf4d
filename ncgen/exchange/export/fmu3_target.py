"""A functional mock-up unit of FMI 3.0."""

from __future__ import annotations

from collections.abc import Sequence

from ncgen.exchange.export.fmu import fmu, others
from ncgen.exchange.export.package import Package


def check(platforms: Sequence[str]) -> None:
    """Raise NcgenError for a platform that no unit of this version can be made for here."""
    others(platforms, 3)


def files(package: Package, platforms: Sequence[str] = ()) -> dict[str, bytes]:
    """{file name: the unit}. platforms: as of `fmu`."""
    return {f"{package.prefix}.fmu": fmu(package, 3, platforms)}
