"""Which compiler is taken, and what is said when there is none or it refuses."""

from __future__ import annotations

import importlib.util
import os
import shutil
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from tiny import TINY

import ncgen
from ncgen.build.cache import build, entries
from ncgen.build.compilers import find_compiler
from ncgen.errors import CompileError, ModelError, NcgenError

LOG = "tiny.c:1: something is wrong\nand here is why\n"


def one_line(caught) -> str:
    """The message of an error, which must be one line."""
    message = str(caught.value)
    assert message and "\n" not in message
    return message


@pytest.fixture
def no_compiler(monkeypatch):
    """A machine without any compiler."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(shutil, "which", lambda *_, **__: None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda *_, **__: None)


@pytest.mark.parametrize("name", ["no-such-compiler", "/no/such/compiler -O2"])
def test_a_compiler_that_does_not_exist(monkeypatch, name):
    """$CC that names nothing is an error that quotes it, even where another compiler could be found."""
    monkeypatch.setenv("CC", name)
    with pytest.raises(CompileError) as caught:
        find_compiler()
    assert f"CC={name}" in one_line(caught)
    assert caught.value.exit_code == 3


@pytest.mark.parametrize("name", ["   ", "'gcc"])
def test_a_compiler_that_is_no_word(monkeypatch, name):
    """Blanks count as unset, an open quote is an error of one line."""
    monkeypatch.setenv("CC", name)
    if not name.strip():
        assert find_compiler().command == (shutil.which("cc") or shutil.which("gcc") or shutil.which("clang"),)
        return
    with pytest.raises(CompileError) as caught:
        find_compiler()
    assert f"CC={name}" in one_line(caught)


def test_options_in_cc_are_kept(monkeypatch, cache):
    """$CC may hold options, also with blanks in quotes; they reach the compiler."""
    monkeypatch.setenv("CC", "cc '-DTINY_EXTRA=1 + 1' -g")
    compiler = find_compiler()
    assert compiler.command == (shutil.which("cc"), "-DTINY_EXTRA=1 + 1", "-g")
    build({"extra.c": "int extra(void) { return TINY_EXTRA; }\n"}, compiler)


def test_a_relative_path_in_cc(scripted, monkeypatch, tmp_path, cache):
    """$CC may be a path relative to where the user is."""
    scripted('exec $CC "$@"')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CC", "./compiler")
    assert build(TINY, find_compiler()).library.is_file()


def test_the_order_of_the_search(monkeypatch):
    """Without $CC: cc, then gcc, then clang, then the compiler of the Python package ziglang."""
    monkeypatch.delenv("CC", raising=False)
    there: set[str] = {"cc", "gcc", "clang"}
    monkeypatch.setattr(shutil, "which", lambda name, *_, **__: sys.executable + f"/../{name}" if name in there else None)
    monkeypatch.setattr("ncgen.build.compilers._identity", lambda path: path)
    found = []
    for gone in ("cc", "gcc", "clang"):
        found.append(Path(find_compiler().command[0]).name)
        there.remove(gone)
    assert found == ["cc", "gcc", "clang"]
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *_, **__: object() if name == "ziglang" else None)
    assert find_compiler().command == (sys.executable, "-m", "ziglang", "cc")


def test_without_a_compiler_auto_is_numpy(no_compiler, pendulum_sources):
    """One line of warning, then kernels that work."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        kernels = ncgen.compile(pendulum_sources)
    (warning,) = said
    assert "no C compiler found" in str(warning.message) and "\n" not in str(warning.message)
    assert warning.filename == __file__, "the warning points at the caller"
    assert kernels.backend == "numpy"
    np.testing.assert_allclose(kernels.force(kernels.q0, 0 * kernels.q0), [0.0, -9.81])


def test_without_a_compiler_c_is_an_error(no_compiler, pendulum_sources):
    """Who asks for C is told what is missing and what to do."""
    with pytest.raises(CompileError) as caught:
        ncgen.compile(pendulum_sources, backend="c")
    assert "no C compiler found" in one_line(caught) and "install" in one_line(caught)


def test_an_unknown_backend(pendulum_sources):
    """A backend that does not exist is named, with those that do."""
    with pytest.raises(ModelError) as caught:
        ncgen.compile(pendulum_sources, backend="fortran")
    assert "fortran" in one_line(caught) and "auto, c, numpy" in one_line(caught)


def test_a_compiler_that_refuses(scripted, cache):
    """The log is kept whole in the error, its first complaint is in the message, and nothing is published."""
    scripted("echo 'warning first' >&2; echo 'tiny.c:2: error: no such luck' >&2; echo 'more' >&2; exit 1")
    with pytest.raises(CompileError) as caught:
        build(TINY, find_compiler())
    assert caught.value.log == "warning first\ntiny.c:2: error: no such luck\nmore\n"
    assert "tiny.c:2: error: no such luck" in one_line(caught) and os.environ["CC"] in one_line(caught)
    assert entries() == [] and list(cache.iterdir()) == []


def test_a_compiler_that_refuses_in_its_own_words(scripted, cache):
    """A log without the word error is quoted in one line, too."""
    scripted(f"printf '{LOG.encode('unicode_escape').decode()}' >&2; exit 1")
    with pytest.raises(CompileError) as caught:
        build(TINY, find_compiler())
    assert "something is wrong" in one_line(caught) and caught.value.log == LOG


def test_a_compiler_that_refuses_silently(scripted, cache):
    """No log at all is no reason for a traceback."""
    scripted("exit 1")
    with pytest.raises(CompileError) as caught:
        build(TINY, find_compiler())
    assert "refused" in one_line(caught) and caught.value.log == ""


def test_a_compiler_that_speaks_another_encoding(scripted, cache):
    """A log that is no UTF-8 is shown as far as it can be read."""
    scripted("printf 'error: caf\\351\\n' >&2; exit 1")
    with pytest.raises(CompileError, match="error: caf"):
        build(TINY, find_compiler())


def test_a_compiler_that_only_pretends(scripted, cache):
    """A compiler that returns success and writes nothing is an error, and leaves no entry."""
    scripted("exit 0")
    with pytest.raises(CompileError) as caught:
        build(TINY, find_compiler())
    one_line(caught)
    assert list(cache.iterdir()) == []


def test_a_compiler_that_cannot_be_run(tmp_path, monkeypatch, cache):
    """A file that is executable and no program is reported by its name."""
    fake = tmp_path / "fake"
    fake.write_bytes(b"\x7fELF nothing")
    fake.chmod(0o755)
    monkeypatch.setenv("CC", str(fake))
    with pytest.raises(CompileError) as caught:
        build(TINY, find_compiler())
    assert str(fake) in one_line(caught) and "CC" in one_line(caught)
    assert list(cache.iterdir()) == []


def test_errors_of_the_build_have_their_own_exit_code(scripted, cache, pendulum_sources):
    """From the outside a refusal of the compiler is an NcgenError with exit code 3."""
    scripted("echo error: no >&2; exit 1")
    with pytest.raises(NcgenError) as caught:
        ncgen.compile(pendulum_sources, backend="c")
    assert caught.value.exit_code == 3
