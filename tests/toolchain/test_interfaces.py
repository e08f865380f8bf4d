"""Declarations of C are parsed once, and come from the cache after that: the same types, sizes and functions."""

from __future__ import annotations

import subprocess
import sys

import pytest
from cffi import FFI

from ncgen.toolchain import interfaces
from ncgen.toolchain.abi import HEADERS, NUMBERS, abi, declared, runtime_abi

TYPES = "typedef struct pair { double a; int b[3]; } pair; enum { LARGEST = 7 }; typedef int (*compare)(const pair *, void *);"


@pytest.fixture
def parsings(monkeypatch):
    """The declarations that were parsed."""
    parsed, parse = [], interfaces._described
    monkeypatch.setattr(interfaces, "_described", lambda texts: parsed.append(texts) or parse(texts))
    return parsed


def test_declarations_are_parsed_once(cache, parsings):
    for _ in range(2):
        ffi = interfaces.interface(TYPES + "int compared(compare by);")
        pair = ffi.new("pair *", {"a": 0.5, "b": [1, 2, 3]})
        assert (pair.a, list(pair.b), ffi.sizeof("pair")) == (0.5, [1, 2, 3], FFI().sizeof("double") + 4 * FFI().sizeof("int"))
        assert ffi.callback("compare", lambda one, _: int(one.a * 4))(pair, ffi.NULL) == 2
        assert ffi.typeof("compare") is ffi.typeof("int(*)(const pair *, void *)")
    assert len(parsings) == 1 and len([*(cache / interfaces.KIND).iterdir()]) == 1


def test_a_damaged_entry_is_parsed_again(cache, parsings):
    interfaces.interface(TYPES)
    (entry,) = (cache / interfaces.KIND).iterdir()
    entry.write_bytes(entry.read_bytes()[:-9])
    assert interfaces.interface(TYPES).sizeof("pair") == 24
    assert len(parsings) == 2


def test_types_of_a_base_are_the_same_types(cache):
    """What one library makes can be given to another, whether its declarations were parsed now or before."""
    base = interfaces.base_interface(TYPES)
    for text in ("pair *first(void);", "void last(pair *);", "pair *first(void);"):
        assert interfaces.interface(text, base).typeof("pair *") is base.typeof("pair *")
    with pytest.raises(interfaces._cffi_backend.FFI.error):
        interfaces.interface("int other(void);").typeof("pair *")


@pytest.mark.parametrize("number", NUMBERS)
def test_structs_have_the_sizes_that_cffi_gives_them(number):
    """Of every struct of the headers, next to cffi's own reading of them."""
    ffi = FFI()
    ffi.cdef(f"typedef {number} ncgen_real; typedef {number} ncgen_scalar;" + declared("ncgen.h") + "".join(map(declared, HEADERS)))
    pointers = {name: ffi.typeof(f"{name} *") for name in ffi.list_types()[0]}
    names = [name for name, each in pointers.items() if each.kind == "pointer" and each.item.kind == "struct" and each.item.fields]
    assert {"ncgen_model", "ncgen_options", "ncgen_statistics"} <= {*names}
    assert {name: runtime_abi(number).sizeof(name) for name in names} == {name: ffi.sizeof(name) for name in names}
    assert abi(number).sizeof("ncgen_real") == NUMBERS[number].dtype.itemsize


def test_a_run_from_the_cache_loads_what_it_needs(tmp_path):
    """Neither sympy, nor the parser of declarations, nor the packages around SciPy's LAPACK: each takes a tenth of a second or more."""
    command = [sys.executable, "-X", "importtime", "-m", "ncgen", "run", "fourbar", "-o", str(tmp_path / "out")]
    _, done = (subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path) for _ in range(2))
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "ncgen.solver.lapack" in loaded
    assert loaded & {"sympy", "pycparser", "cffi", "scipy.linalg", "scipy.sparse", "matplotlib", "numpy.f2py"} == set()
