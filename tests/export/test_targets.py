"""Targets are found by their names."""

from __future__ import annotations

import sys

import pytest

import ncgen
import ncgen.exchange.export
from ncgen.errors import ModelError, NcgenError
from ncgen.exchange.export import export, targets

TARGET = '''
"""The size of a mechanism as text."""


def files(package):
    return {"size.txt": f"{package.dof} of {package.kernels.n}", "size.bin": bytes([package.dof, package.kernels.n])}
'''


def test_a_folder_is_named():
    with pytest.raises(NcgenError, match="^output: None given; name a folder$"):
        export(ncgen.load("pendulum"), "c", None)
    with pytest.raises(NcgenError, match="^output: '' given; name a folder$"):
        ncgen.generate(ncgen.load("pendulum")).write("")


def test_a_module_is_a_target(tmp_path, monkeypatch):
    """What lies in the package under a name of this kind is offered and written: the pendulum has two coordinates and one freedom."""
    (tmp_path / "size_target.py").write_text(TARGET)
    known = "c, casadi, fmu2, fmu3, html, joints, python, wasm"
    with pytest.raises(ModelError, match=f"^--to size: there is no such export; choose one of {known}$"):
        export(ncgen.load("pendulum"), "size", tmp_path)
    monkeypatch.setattr(ncgen.exchange.export, "__path__", [*ncgen.exchange.export.__path__, str(tmp_path)])
    assert "size" in targets()
    model = ncgen.Model("bob")
    A, B = model.point("A", (0, 0), fixed=True), model.point("B", (1, 0))
    model.body("rod", [A, B], mass=1.0, inertia="point")
    paths = export(model, "size", tmp_path / "out")
    assert [path.read_bytes() for path in paths] == [b"1 of 2", b"\1\2"]
    del sys.modules["ncgen.exchange.export.size_target"]
