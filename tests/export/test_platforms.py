"""Mock-up units for other machines: the right kind of binary in the right place, with the standard's functions."""

from __future__ import annotations

import importlib.util
import struct
import subprocess
import sys
import zipfile

import pytest
from exported import STRICT

import ncgen
from ncgen.errors import ModelError
from ncgen.exchange.examples import load
from ncgen.exchange.export.fmu import PLATFORMS

pytest.importorskip("fmpy", reason="fmpy is not installed")
needs_zig = pytest.mark.skipif(not importlib.util.find_spec("ziglang"), reason="ziglang is not installed")

ELF, PE, MACH_O = {"x86_64": 62, "aarch64": 183}, {"x86_64": 0x8664}, {"x86_64": 0x01000007, "aarch64": 0x0100000C}
"""Numbers of processors in the headers of binaries: the System V ABI's, Microsoft's and Apple's."""


def machine(data: bytes) -> tuple[str, int]:
    """The kind of a binary and the number of its processor, from its header."""
    if data.startswith(b"\x7fELF"):
        return "linux", struct.unpack_from("<H", data, 18)[0]
    if data.startswith(b"MZ"):
        (header,) = struct.unpack_from("<I", data, 0x3C)
        assert data[header : header + 4] == b"PE\0\0"
        return "windows", struct.unpack_from("<H", data, header + 4)[0]
    magic, processor = struct.unpack_from("<II", data)
    assert magic == 0xFEEDFACF
    return "macos", processor


EXPECTED = {
    2: {"linux64": ("linux", ELF["x86_64"]), "win64": ("windows", PE["x86_64"]), "darwin64": ("macos", MACH_O["x86_64"])},
    3: {
        "x86_64-linux": ("linux", ELF["x86_64"]), "x86_64-windows": ("windows", PE["x86_64"]), "x86_64-darwin": ("macos", MACH_O["x86_64"]),
        "aarch64-darwin": ("macos", MACH_O["aarch64"]), "aarch64-linux": ("linux", ELF["aarch64"]),
    },
}  # fmt: skip


@needs_zig
@pytest.mark.slow
@pytest.mark.parametrize("version", [2, 3])
def test_binaries_for_every_platform(version, tmp_path):
    """zig builds a C library for each platform once, which takes a minute or two."""
    platforms = [name for name, platform in PLATFORMS.items() if version in platform.folders]
    (path,) = ncgen.export(load("pendulum"), f"fmu{version}", tmp_path, platforms)
    with zipfile.ZipFile(path) as unit:
        unit.extractall(tmp_path)
    found = {binary.parent.name: binary.read_bytes() for binary in tmp_path.glob("binaries/*/*")}
    assert {folder: machine(data) for folder, data in found.items()} == EXPECTED[version]
    for data in found.values():
        assert all(f"fmi{version}{name}".encode() in data for name in ("DoStep", "GetDirectionalDerivative", "Terminate"))


@needs_zig
@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in PLATFORMS])
def test_sources_compile_elsewhere_without_a_warning(name, tmp_path):
    (path,) = ncgen.export(load("cartpole"), "fmu3", tmp_path)
    with zipfile.ZipFile(path) as unit:
        unit.extractall(tmp_path)
    folder = tmp_path / "sources"
    compiler = [sys.executable, "-m", "ziglang", "cc", "-target", PLATFORMS[name].target]
    flags = ["-std=c99", "-O1", *STRICT.split(), "-Wno-strict-prototypes", "-c", "-o", "unit.o"]  # the standard's headers have some
    for file in sorted(folder.glob("*.c")):
        done = subprocess.run([*compiler, *flags, file.name], cwd=folder, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")


def test_unknown_platforms_are_refused(tmp_path, monkeypatch):
    """Before anything is generated."""
    monkeypatch.setattr("ncgen.exchange.export._package", None)
    with pytest.raises(ModelError, match="platforms: macos-arm is unknown to fmu2; choose among linux, windows, macos"):
        ncgen.export(load("pendulum"), "fmu2", tmp_path, ["macos-arm"])
    with pytest.raises(ModelError, match="platforms: c is written as sources, for any machine; leave it out"):
        ncgen.export(load("pendulum"), "c", tmp_path, ["macos"])
    assert not [*tmp_path.iterdir()]
