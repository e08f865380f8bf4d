"""A model can be called anything: its files, symbols and packages never hide what its code needs."""

import re
import subprocess
import sys
import zipfile
from pathlib import PurePath

import pytest

import ncgen
from ncgen.emit.naming import prefix_of
from ncgen.emit.taken import TAKEN
from ncgen.exchange.export import targets
from ncgen.exchange.export.wasm_target import CONSTANTS
from ncgen.resources import folder


def pendulum(name):
    m = ncgen.Model(name)
    A, B = m.point("A", (0, 0), fixed=True), m.point("B", (1, 0))
    x, z = m.vector("x", (1, 0, 0), fixed=True), m.vector("z", (0, 0, 1), fixed=True)
    m.body("rod", [A, B], mass=1.0, inertia="rod")
    m.independent(m.angle("phi", x, B - A, z))
    m.gravity((0, -9.81, 0))
    return m


def run(*command, cwd):
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.mark.parametrize("name", ["stdio", "stdint", "math"])
def test_headers_are_those_of_c(name, tmp_path):
    """Every source of the export is compiled with its own folders before the system's."""
    files = ncgen.export(pendulum(name), "c", tmp_path)
    sources = [str(file) for file in files if file.suffix == ".c" and file.parent.name == "src"]
    run("gcc", "-std=c99", "-Wall", "-Werror", "-fsyntax-only", "-Iinclude", "-Isrc", *sources, cwd=tmp_path)


@pytest.mark.parametrize("name", ["link", "clock", "std", "string", "linux"])
def test_the_namespace_is_its_own(name, tmp_path):
    ncgen.export(pendulum(name), "c", tmp_path)
    text = f'#include <unistd.h>\n#include <ctime>\n#include "{prefix_of(name)}.hpp"\n{prefix_of(name)}::mechanism m;\n'
    (tmp_path / "user.cpp").write_text(text, encoding="utf-8")
    run("g++", "-fsyntax-only", "-Wall", "-Werror", "-Iinclude", "user.cpp", cwd=tmp_path)


@pytest.mark.parametrize("name", ["types", "re", "Class", "numpy", "src"])
def test_the_package_hides_no_module(name, tmp_path):
    ncgen.export(pendulum(name), "python", tmp_path)
    run(sys.executable, "setup.py", "--quiet", "build_ext", "--inplace", cwd=tmp_path)
    package = prefix_of(name).lower()
    run(sys.executable, "-c", f"import {package}; m = {package}.Motion(); m.advance(0.01)", cwd=tmp_path)


@pytest.mark.parametrize("name", ["Error", "math", "N", "STATE"])
def test_the_class_hides_no_object(name, tmp_path):
    ncgen.export(pendulum(name), "wasm", tmp_path)
    assert len(run("node", "main.mjs", "0.1", "3", cwd=tmp_path).splitlines()) >= 3


def test_constants_of_the_wrapper_are_known():
    text = (folder("templates") / "package/wasm/wrapper.js.jinja").read_text(encoding="utf-8")
    lines = re.findall(r"^const (.*)", text, re.MULTILINE)
    assert CONSTANTS == {name for line in lines for name in re.findall(r"(?:^|, )([A-Z_]+) =", line)}


def test_what_stands_beside_a_models_files_is_taken(tmp_path):
    """Of every target: no file, folder or source has a name that a model's could have, too."""
    seen = set()
    for target in targets():
        for file in ncgen.export(pendulum("zqz"), target, tmp_path / target):
            names = zipfile.ZipFile(file).namelist() if file.suffix == ".fmu" else [str(file.relative_to(tmp_path / target))]
            seen |= {PurePath(name).name.split(".")[0].lower() for name in names if name.endswith((".c", ".h", ".py", ".js", ".mjs"))}
    beside = {name for name in seen if not name.startswith(("zqz", "__"))}
    inner = {"common", "compiled"}  # within the package itself
    assert {"main", "fmi2", "fmi3", "instance", "setup"} <= beside
    assert beside - inner <= TAKEN | {name for name in beside if name.startswith(("fmi2", "fmi3", "ncgen"))}


def test_ordinary_names_are_kept():
    assert [prefix_of(name) for name in ("arm", "fourbar", "Robot", "my_stdio")] == ["arm", "fourbar", "Robot", "my_stdio"]
    assert [prefix_of(name) for name in ("stdio", "RE", "class", "Class", "aux")] == ["stdio_", "RE_", "class_", "Class_", "aux_"]


def test_a_models_own_code_runs_whatever_its_name():
    for name in ("stdio", "types"):
        k = ncgen.compile(pendulum(name))
        assert ncgen.simulate(k, 0.1, points=2).q.shape == (2, k.n)
