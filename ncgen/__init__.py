"""ncgen: multibody systems in natural coordinates, from equations to compiled kernels.

    model = ncgen.load("robot")
    robot = ncgen.compile(model)
    run = ncgen.simulate(robot, 0.5)

Importing ncgen is quick: what a name needs is loaded when the name is used.
"""

from __future__ import annotations

from importlib import import_module
from sys import modules

__version__ = "0.1.0"


def _homes() -> dict[str, str]:
    """Return {public name: its module}, as `__init__.pyi` lists them: the one list that type checkers read as well."""
    lines = __loader__.get_data(f"{__path__[0]}/__init__.pyi").decode().splitlines()  # type: ignore[union-attr]
    return {line.split()[5]: line.split()[1] for line in lines if line.startswith("from ")}


_HOMES = _homes()
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is not None:
        return getattr(modules.get(home) or _imported(home), name)
    if name.removesuffix("_batch") in _HOMES and name.endswith("_batch"):
        today = name.removesuffix("_batch")
        raise AttributeError(f"ncgen.{name} is now ncgen.{today}, called with rows of states (docs/renamed.md)")
    raise AttributeError(f"module 'ncgen' has no attribute {name!r}")


def _imported(name: str) -> object:
    """The module of a name, with what it needs."""
    with import_module("ncgen.toolchain.undisturbed").undisturbed():
        return import_module(name)


def __dir__() -> list[str]:
    return __all__
