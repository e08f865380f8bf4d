"""Exports: a folder that builds and runs where Python is not.

A target is a module `NAME_target` here, found by its name, with a function `files(package)`: {path in the folder: text or bytes}, of a
`Package`, or, where it does without the mechanism's motion, `files_of(model)`; templates/package/NAME holds its templates. One whose motion
goes through events says so by HAS_EVENTS. One with
binaries for other machines has `check(platforms)`, which refuses unknown ones before anything is generated, and `files` takes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING

from ncgen.errors import ModelError
from ncgen.files import argument_was, path_of, write_bytes
from ncgen.model.model import checked_model

if TYPE_CHECKING:
    from ncgen.exchange.export.package import Package
    from ncgen.model import Model

END = "_target"


def targets() -> tuple[str, ...]:
    """The names of all targets."""
    return tuple(sorted(module.name.removesuffix(END) for module in iter_modules(__path__) if module.name.endswith(END)))


def _package(model: Model, events: bool) -> Package:
    from ncgen.exchange.export.package import package

    return package(model, events)


@argument_was("folder")
def export(model: Model, to: str, output: Path | str, platforms: Sequence[str] = ()) -> list[Path]:
    """Write a mechanism for use without ncgen.

    Parameters
    ----------
    model : Model
        Mechanism.
    to : str
        Target: c, casadi, fmu2, fmu3, html, joints, python or wasm.
    output : path
        Folder; it is created if it does not exist.
    platforms : sequence of str
        Platforms besides this one for which an FMU has binaries: "linux", "windows", "macos", and in FMI 3.0 "linux-arm" and "macos-arm".
        The package ziglang compiles them.

    Returns
    -------
    list of Path
        The files, in order.

    Raises
    ------
    ModelError
        Where the target is unknown, or the mechanism cannot be exported.
    NcgenError
        If a file cannot be written.
    """
    if to not in targets():
        raise ModelError(f"--to {to}: there is no such export; choose one of {', '.join(targets())}")
    folder = path_of(output, "folder")

    model, target = checked_model(model), import_module(f"{__name__}.{to}{END}")
    more = {"platforms": platforms} if platforms else {}
    if platforms:
        if not hasattr(target, "check"):
            raise ModelError(f"platforms: {to} is written as sources, for any machine; leave it out")
        target.check(platforms)
    whole = hasattr(target, "files_of")
    files = target.files_of(model) if whole else target.files(_package(model, getattr(target, "HAS_EVENTS", False)), **more)
    contents = {name: data if isinstance(data, bytes) else data.encode() for name, data in files.items()}
    return [write_bytes(folder / name, data) for name, data in contents.items()]
