"""A library takes the objects that another one was made of, where they are as they were written."""

import ctypes
import json

import pytest

from ncgen.toolchain import cache, compilers
from ncgen.toolchain.cache import RECORD, Sibling, compiled

SMALL = {"one.c": "int one(void) { return 1; }\n", "two.c": "int two(void) { return 2; }\n"}
THREE = "int one(void);\nint three(void) { return one() + 2; }\n"
LARGE = {"one.c": SMALL["one.c"], "two.c": "int two(void) { return 4; }\n", "three.c": THREE}
FLAGS = ("-O0", "-fPIC", "-shared")


@pytest.fixture(autouse=True)
def apart(monkeypatch, tmp_path):
    """Every source is compiled by itself, and the cache is empty."""
    monkeypatch.setattr(compilers, "FEW_SOURCES", 1)
    monkeypatch.setattr(compilers.os, "cpu_count", lambda: 2)
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path / "cache"))


def numbers(library, *names):
    loaded = ctypes.CDLL(str(library))
    return [getattr(loaded, name)() for name in names]


def test_objects_of_a_sibling_are_taken_and_others_compiled():
    small = compiled(SMALL, FLAGS).library
    large = compiled(LARGE, FLAGS, siblings=lambda: [Sibling(SMALL, FLAGS, ("one.c",))]).library
    command = json.loads((large.parent / RECORD).read_text(encoding="utf-8").partition("\n")[2])["command"]
    assert str(small.parent / "one.o") in command and str(small.parent / "two.o") not in command
    assert numbers(large, "one", "two", "three") == [1, 4, 3]


def test_an_object_that_somebody_changed_is_compiled_again():
    small = compiled(SMALL, FLAGS).library
    (small.parent / "one.o").write_bytes(b"something else")
    large = compiled(LARGE, FLAGS, siblings=lambda: [Sibling(SMALL, FLAGS, ("one.c",))]).library
    assert numbers(large, "one", "three") == [1, 3]


def test_without_the_sibling_all_is_compiled():
    large = compiled(LARGE, FLAGS, siblings=lambda: [Sibling(SMALL, FLAGS, ("one.c",))]).library
    assert numbers(large, "one", "two", "three") == [1, 4, 3]
    compiler = compilers.find_compiler()
    assert compiler and not cache._objects([Sibling(SMALL, FLAGS, ("one.c",))], compiler, compilers.LIBRARIES)


def test_objects_come_from_several_siblings():
    one, three = ({name: LARGE[name] for name in names} for names in (("one.c", "two.c"), ("one.c", "three.c")))
    first, second = compiled(one, FLAGS).library, compiled(three, FLAGS).library
    siblings = [Sibling(one, FLAGS, ("two.c",)), Sibling(three, FLAGS, ("one.c", "three.c"))]
    large = compiled(LARGE, FLAGS, siblings=lambda: siblings).library
    command = json.loads((large.parent / RECORD).read_text(encoding="utf-8").partition("\n")[2])["command"]
    assert {str(first.parent / "two.o"), str(second.parent / "one.o"), str(second.parent / "three.o")} <= set(command)
    assert numbers(large, "one", "two", "three") == [1, 4, 3]


def test_nothing_asks_for_siblings_of_a_library_that_is_there():
    small = compiled(SMALL, FLAGS).library
    assert compiled(SMALL, FLAGS, siblings=lambda: pytest.fail("siblings of a library that is in the cache")).library == small
