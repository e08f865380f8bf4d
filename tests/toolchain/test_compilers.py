"""Which compiler is taken, and what is said when there is none or it refuses."""

from __future__ import annotations

import ctypes
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
from ncgen.errors import CompileError, ModelError, NcgenError
from ncgen.mechanism import direct, runtime_library
from ncgen.mechanism.kernel_batch import LANES
from ncgen.toolchain import compilers
from ncgen.toolchain.cache import build, compiled, entries
from ncgen.toolchain.compilers import (
    DISABLED_PASSES,
    FLAGS_FOR_LONG_CODE,
    LIBRARY,
    OPTIONAL,
    OPTIONAL_FLAGS,
    Compiler,
    find_compiler,
    make_library,
)

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


def test_own_flags_come_last(monkeypatch, cache):
    """What NCGEN_CFLAGS says holds against ncgen's own flags, and is another library; what cannot be read is refused in one line."""
    source = {"extra.c": "#ifdef NCGEN_TRIED\nint extra(void) { return 1; }\n#endif\n"}
    monkeypatch.setenv("NCGEN_CFLAGS", "-O1 -DNCGEN_TRIED")
    fast = compiled(source)
    assert ctypes.CDLL(str(fast.library)).extra() == 1
    monkeypatch.setenv("NCGEN_CFLAGS", "")
    assert compiled(source).library != fast.library
    monkeypatch.setenv("NCGEN_CFLAGS", "-O1 '-g")
    with pytest.raises(CompileError) as caught:
        compiled(source)
    assert "NCGEN_CFLAGS=-O1 '-g" in one_line(caught)


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
    monkeypatch.setattr("ncgen.toolchain.compilers._identity", lambda path: path)
    found = []
    for gone in ("cc", "gcc", "clang"):
        found.append(Path(find_compiler().command[0]).name)
        there.remove(gone)
    assert found == ["cc", "gcc", "clang"]
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *_, **__: object() if name == "ziglang" else None)
    monkeypatch.setattr("importlib.metadata.version", lambda name: "0.12")
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


# -- compilers that do not do what they should ------------------------------------------------------------------------------


@pytest.fixture
def said():
    """All warnings of a test."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield found


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    """Compilers are given up quickly, and what another test has learnt is forgotten."""
    monkeypatch.setattr(compilers, "TIME_LIMIT", 3.0)
    monkeypatch.setattr(compilers, "_useless", {})
    monkeypatch.setattr(compilers, "_refused", {})
    compilers._fails.cache_clear()


@pytest.fixture
def path_of(tmp_path, monkeypatch):
    """path_of(cc="body", gcc="body"): these scripts are the only compilers on the path; $CC in a body is the real one."""
    real = shutil.which("gcc") or shutil.which("cc")
    tools = os.environ["PATH"]

    def make(**bodies: str) -> None:
        folder = tmp_path / "bin"
        folder.mkdir()
        for name, body in bodies.items():
            (folder / name).write_text(f"#!/bin/sh\nCC={real}\nPATH={tools}\n# {name}\n{body}\n")
            (folder / name).chmod(0o755)
        monkeypatch.delenv("CC", raising=False)
        monkeypatch.setenv("PATH", str(folder))
        monkeypatch.setattr(importlib.util, "find_spec", lambda *_, **__: None)

    return make


FAULTS = {
    "refuses": ("echo 'error: no' >&2; exit 1", "refused"),
    "exists only in name": ("echo 'note: no developer tools were found' >&2; exit 1", "no developer tools"),
    "pretends": ("exit 0", "wrote no library"),
    "writes text": ("echo garbage > model.so", "cannot be loaded"),
    "writes half": ('"$CC" "$@" && head -c 9000 model.so > half && cat half > model.so', "not whole"),
    "writes an object": ('for word; do case "$word" in *.c) exec "$CC" -c "$word" -o model.so;; esac; done', "cannot be loaded"),
    "crashes": ("kill -SEGV $$", "signal 11"),
    "hangs": ("sleep 600", "was stopped after its limit"),
    "hangs with children": ("sleep 600 & sleep 600 & wait", "was stopped after its limit"),
    "reads from the terminal": ("cat; exit 1", "refused"),
}
WORKS = 'exec "$CC" "$@"'


@pytest.mark.parametrize("fault", FAULTS)
def test_the_next_compiler_is_taken(path_of, cache, said, fault):
    """One warning says what happened; it is not found out again, and whatever is built later knows it, too."""
    body, words = FAULTS[fault]
    path_of(cc=body, gcc=WORKS)
    for number in range(2):
        built = compiled(TINY | {"tiny.h": TINY["tiny.h"] + f"/* {number} */"})
        assert ctypes.CDLL(str(built.library)).tiny() == 7
    (warning,) = said
    text = str(warning.message)
    assert text.startswith("cc ") and words in text and text.endswith("; gcc is used instead") and "\n" not in text and len(text) <= 300
    assert len(entries()) == 2 == len(list(cache.iterdir())), "nothing else was published or left behind"


@pytest.mark.parametrize("fault", ["refuses", "writes half", "crashes", "hangs with children"])
def test_numpy_at_last(scripted, cache, said, pendulum_sources, monkeypatch, fault):
    """A compiler that $CC names is the only one; with backend="c" it is an error with the log."""
    body, words = FAULTS[fault]
    monkeypatch.setattr(compilers, "SECONDS_PER_KILOBYTE", 0.0)
    scripted(f"echo 'a line of the log' >&2; {body}")
    for _ in range(2):
        kernels = ncgen.compile(pendulum_sources)
        assert kernels.backend == "numpy"
        np.testing.assert_allclose(kernels.force(kernels.q0, 0 * kernels.q0), [0.0, -9.81])
    for warning in said:
        text = str(warning.message)
        assert words in text and "NumPy" in text and os.environ["CC"] in text and "\n" not in text and len(text) <= 300
    assert len(said) == 2, "one a compilation"
    with pytest.raises(CompileError) as caught:
        ncgen.compile(pendulum_sources, backend="c")
    assert words in one_line(caught) and ("a line of the log" in caught.value.log or "hangs" in fault)


def test_all_that_failed_is_said(path_of, cache, said, pendulum_sources):
    path_of(cc=FAULTS["refuses"][0], gcc=FAULTS["pretends"][0], clang=FAULTS["crashes"][0])
    assert ncgen.compile(pendulum_sources).backend == "numpy"
    (warning,) = said
    text = str(warning.message)
    assert all(word in text for word in ("cc refused", "gcc reported success", "clang crashed")) and len(text) <= 300
    assert list(cache.iterdir()) == []


@pytest.mark.parametrize("flag", OPTIONAL)
def test_a_flag_that_is_refused_is_left_out(scripted, cache, said, flag, tmp_path):
    """Code is slower without it and no different, which is said where it is worth a word. The second time it is known."""
    refuse = f'for word; do [ "$word" = {flag} ] && {{ echo "error: unknown option $word" >&2; exit 1; }}; done'
    scripted(f'echo >> {tmp_path}/log; {refuse}; exec $CC "$@"')
    flags = (*LANES[:-2], *FLAGS_FOR_LONG_CODE, *DISABLED_PASSES, "-fopenmp", "-fcx-limited-range")
    assert ctypes.CDLL(str(compiled(TINY, flags).library)).tiny() == 7
    asked = (tmp_path / "log").read_text().count("\n")
    compiled(TINY | {"more.c": "int more;\n"}, flags)
    assert (tmp_path / "log").read_text().count("\n") == asked + 1
    texts = [str(warning.message) for warning in said]
    assert texts == [] if flag in OPTIONAL_FLAGS else len(texts) == 1 and f"refuses {flag} and is used without it" in texts[0]


def test_a_whole_run_without_a_flag(scripted, cache, said):
    """Model, runtime, tangents, emitted dynamics, batches and direct calls are built by the same way."""
    scripted('for word; do [ "$word" = -march=native ] && exit 1; done; exec $CC "$@"')
    runtime_library.runtime_of.cache_clear(), direct._caller.cache_clear()
    kernels = ncgen.compile(ncgen.load("pendulum"))
    assert kernels.backend == "c"
    assert ncgen.simulate(kernels, 0.02, engine="emitted").engine.startswith("emitted")
    assert ncgen.simulate(kernels, 0.02, integrator="radau").engine == "c"
    kernels.batch.gamma([kernels.q0], [kernels.q0]), kernels.direct("phi")()
    ncgen.simulate(kernels, 0.02, q0=[kernels.q0] * 2)
    runtime_library.runtime_of.cache_clear(), direct._caller.cache_clear()
    assert len([w for w in said if "-march=native" in str(w.message)]) == 1 == len(said)


def test_wrong_sources_are_no_compilers_fault(cache, said):
    """The compiler's words come back, and it is used again."""
    with pytest.raises(CompileError, match="refused the generated C") as caught:
        compiled({"wrong.c": "int wrong(void) { return nothing; }\n"})
    assert "nothing" in caught.value.log
    assert ctypes.CDLL(str(compiled(TINY).library)).tiny() == 7 and not said


def test_what_hangs_is_ended_with_its_children(scripted, cache, tmp_path):
    """No process is left, whether they heed a polite word or not."""
    scripted(f"trap '' TERM; sleep 600 & echo $! $$ > {tmp_path}/pids; wait")
    with pytest.raises(CompileError, match="was stopped after its limit of 3"):
        build(TINY, find_compiler())
    for pid in (tmp_path / "pids").read_text().split():
        state = Path(f"/proc/{pid}/stat")
        assert not state.exists() or state.read_text().rpartition(")")[2].split()[0] == "Z"


def test_patience_grows_with_the_source(monkeypatch, tmp_path):
    """A second for every thousand bytes, up to hours; how long a compiler is waited for is no more than that."""
    waited = []

    def run(compiler, command, folder, time_limit):
        waited.append(time_limit)
        (folder / LIBRARY).touch()
        return ""

    monkeypatch.setattr(compilers, "_run", run)
    for size in (0, 100_000, 10**8):
        monkeypatch.setattr(Path, "write_text", lambda *_, **__: None)
        compilers.make_library(tmp_path, compilers.Recipe({"a.c": " " * size}, find_compiler(), ()), loads=False)
    assert waited == [3.0, 103.0, compilers.MAX_TIME_LIMIT]


ZIG = """#!/bin/sh
# As zig does, with -c an object of the first source alone.
apart=; for word in "$@"; do [ "$word" = -c ] && apart=yes; done
sources=0
for word do
    shift
    case "$word" in *.c) sources=$((sources + 1)); [ "$apart" ] && [ $sources -gt 1 ] && continue;; esac
    set -- "$@" "$word"
done
exec {cc} "$@"
"""


@pytest.mark.skipif(not shutil.which("cc"), reason="there is no cc")
def test_zig_is_given_all_sources_at_once(tmp_path, monkeypatch):
    """It makes one object a call, so a library of many sources could not be linked."""
    script = tmp_path / "zig"
    script.write_text(ZIG.replace("{cc}", shutil.which("cc")))
    script.chmod(0o755)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    monkeypatch.setattr(compilers, "TIME_LIMIT", 60.0)
    (tmp_path / "built").mkdir()
    files = {f"part{k}.c": f"int part{k}(void);\nint part{k}(void) {{ return {k}; }}\n" for k in range(4 * compilers.FEW_SOURCES)}
    make_library(tmp_path / "built", compilers.Recipe(files, Compiler((str(script),), "zig"), ("-shared", "-fPIC")))
    library = ctypes.CDLL(str(tmp_path / "built" / LIBRARY))
    assert [getattr(library, f"part{k}")() for k in range(len(files))] == list(range(len(files)))
