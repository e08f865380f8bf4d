"""Exports: a folder that builds and runs where Python is not."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from ncgen.emit.sources import write_bytes
from ncgen.errors import ModelError
from ncgen.model import Model

TARGETS = ("c", "fmu2", "fmu3", "wasm", "python", "numpy")


def export(model: Model, to: str, folder: Path | str) -> list[Path]:
    """Write a mechanism for use without ncgen; returns the paths of the files, in order.

    to: one of TARGETS

    Raises ModelError where the target is unknown or the mechanism's motion cannot be exported, saying why; NcgenError if a
    file cannot be written.
    """
    if to not in TARGETS:
        raise ModelError(f"--to {to}: there is no such export; choose one of {', '.join(TARGETS)}")
    from ncgen.exchange.export.package import package

    files = import_module(f"ncgen.exchange.export.{to}_target").files(package(model))
    contents = {name: data if isinstance(data, bytes) else data.encode() for name, data in files.items()}
    return [write_bytes(Path(folder) / name, data) for name, data in contents.items()]
