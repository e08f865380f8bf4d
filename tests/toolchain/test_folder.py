"""Whose the cache is: nothing that others could have written is run, and a folder that cannot be used is no error."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from tiny import TINY

import ncgen
from ncgen.mechanism.recall import recall
from ncgen.toolchain import cache_location
from ncgen.toolchain.cache import build, clear, compiled, entries
from ncgen.toolchain.cache_location import cache_folder, intruder, keep, kept
from ncgen.toolchain.compilers import LIBRARY, find_compiler

OTHER = 12345
"""Number of another user."""

TRAP = {"tiny.c": "int tiny(void) { return 666; }\n", "tiny.h": ""}
KEY = "0123456789" * 4


@pytest.fixture(autouse=True)
def forgotten(monkeypatch):
    """Nothing has been said yet."""
    monkeypatch.setattr(cache_location, "_stand_ins", {})


@pytest.fixture
def said():
    """Messages of the warnings of a test, all of them."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        yield found


def the_line(said, *words) -> None:
    """One warning of one line, which names the variable that helps."""
    (warning,) = said
    text = str(warning.message)
    assert all(word in text for word in ("NCGEN_CACHE_DIR", *words)) and "\n" not in text and len(text) <= 300, text


def works(library: Path) -> bool:
    return ctypes.CDLL(str(library)).tiny() == 7


@pytest.fixture
def give(monkeypatch):
    """give(path): from now on it is another user's; where only root may give away, whoever runs the tests becomes another user."""

    def away(path: Path) -> None:
        if os.geteuid():
            monkeypatch.setattr(cache_location, "_owners", lambda: {0, OTHER})
        else:
            os.chown(path, OTHER, OTHER)

    return away


def opened(cache: Path, how: str, give) -> None:
    """Let others have a say in a folder."""
    if how == "owner":
        give(cache)
    elif how == "world":
        cache.chmod(0o777)
    elif how == "group":
        give(cache) if os.geteuid() else os.chown(cache, -1, OTHER)
        cache.chmod(0o775)
    elif how == "above":
        cache.parent.chmod(0o777)
    else:
        cache.chmod(0o1777)


@pytest.mark.parametrize("way", ["owner", "group", "world", "above", "sticky"])
def test_a_folder_that_is_not_the_users_alone(tmp_path, monkeypatch, said, give, way):
    """What lies in it is neither loaded nor recalled, nothing is written to it, and it is said once."""
    cache = tmp_path / "above" / "cache"
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(cache))
    library = build(TINY, find_compiler()).library
    keep("programs", KEY, "planted")
    trap = build(TRAP, find_compiler()).library
    shutil.copy(trap, library)
    before = sorted(cache.rglob("*"))
    opened(cache, way, give)
    for _ in range(2):
        found = build(TINY, find_compiler()).library
        assert cache not in found.parents and works(found)
        assert kept("programs", KEY) is None
    assert build(TINY, find_compiler()).seconds == 0.0, "the folder that stands in is a cache, too"
    assert sorted(cache.rglob("*")) == before
    the_line(said, str(cache.parent))
    cache.chmod(0o755), cache.parent.chmod(0o755)


def test_a_sticky_folder_above_is_right(tmp_path, monkeypatch, said):
    """As /tmp is: others can add files there, but not replace this user's."""
    tmp_path.chmod(0o1777)
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path / "cache"))
    assert (tmp_path / "cache") in build(TINY, find_compiler()).library.parents and not said


@pytest.mark.parametrize("what", ["entry", "library", "record", "kept"])
def test_planted_before_the_folder_was_closed(cache, what):
    """A file of another user inside a folder that is in order now: it is not used, and is made anew."""
    if os.geteuid():
        return  # only root can give single files away
    library = build(TINY, find_compiler()).library
    keep("facts", KEY, 1)
    shutil.copy(build(TRAP, find_compiler()).library, library) if what == "library" else None
    places = {"entry": library.parent, "library": library, "record": library.parent / "build.json", "kept": cache / "facts" / f"{KEY}.json"}
    os.chown(places[what], OTHER, OTHER)
    assert (kept("facts", KEY) is None) == (what == "kept")
    again = build(TINY, find_compiler())
    assert (again.seconds > 0) == (what != "kept") and again.library == library and works(library)
    assert build(TINY, find_compiler()).seconds == 0.0


def test_open_files_are_not_used(cache):
    library = build(TINY, find_compiler()).library
    library.chmod(0o666)
    assert build(TINY, find_compiler()).seconds > 0.0 and library.stat().st_mode & 0o022 == 0


def test_links_are_followed_once(tmp_path, monkeypatch):
    """The folder may be a link, which is followed; an entry may not."""
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path / "link"))
    library = build(TINY, find_compiler()).library
    assert library.parent.parent == tmp_path / "real"
    library.parent.rename(tmp_path / "elsewhere")
    library.parent.symlink_to(tmp_path / "elsewhere")
    assert "symbolic link" in intruder(library)


@pytest.mark.parametrize("umask", [0o000, 0o002, 0o077])
def test_any_umask(tmp_path, monkeypatch, said, umask):
    """Folders and files are closed to others whatever the shell's habits are, and are found again."""
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path / "a" / "b"))
    before = os.umask(umask)
    try:
        build(TINY, find_compiler()), keep("facts", KEY, [1])
    finally:
        os.umask(before)
    assert build(TINY, find_compiler()).seconds == 0.0 and kept("facts", KEY) == [1] and not said
    assert all(path.stat().st_mode & 0o022 == 0 for path in (tmp_path / "a").rglob("*"))


@pytest.mark.parametrize("place", ["file", "below a file", "/proc/nothing/here"])
def test_a_cache_that_cannot_be_written(place, tmp_path, monkeypatch, said):
    """Everything works from a folder of this process, which is named in one warning and gone with the process."""
    (tmp_path / "file").write_text("in the way")
    wanted = {"file": tmp_path / "file", "below a file": tmp_path / "file" / "cache"}.get(place, Path(place))
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(wanted))
    first, second = build(TINY, find_compiler()), build(TINY, find_compiler())
    assert works(first.library) and second.library == first.library and second.seconds == 0.0
    keep("facts", KEY, 3)
    assert kept("facts", KEY) == 3
    the_line(said, str(wanted), "cannot be written")
    assert entries() == [] and clear() == 0
    assert (tmp_path / "file").read_text() == "in the way"


def mounted(tmp_path: Path, options: str):
    """A file system of one megabyte, or a skip where there are no mounts."""
    place = tmp_path / "disk"
    place.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", options, "none", place], capture_output=True).returncode:
        return None
    return place


@pytest.fixture
def disk(tmp_path):
    """disk(options): a small file system, None where this process may not mount one."""
    made = []

    def make(options: str):
        made.append(mounted(tmp_path, options))
        return made[-1]

    yield make
    for place in filter(None, made):
        subprocess.run(["umount", "-l", place], check=True)


def test_a_disk_that_is_full(disk, tmp_path, monkeypatch, said, scripted):
    """Full from the start, or while the compiler writes: the work is done elsewhere, and the cache can be cleared."""
    place = disk("size=64k,mode=755")
    if place:
        (place / "filler").write_bytes(bytes(40_000))
    else:  # as a compiler says it
        place = tmp_path / "cache"
        scripted(f'case "$PWD" in {place}*) echo "as: error: No space left on device" >&2; exit 1;; esac; exec $CC "$@"')
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(place))
    big = TINY | {"more.c": "double table[] = {" + ",".join(map(str, range(4000))) + "};\n"}
    assert works(build(big, find_compiler()).library)
    the_line(said, "No space left on device")
    assert clear() == 0 and (not (place / "filler").exists() or [p.name for p in place.iterdir()] == ["filler"])


def test_a_disk_that_is_read_only(disk, monkeypatch, said):
    """What is there already is used; what is not is made elsewhere; clearing says why it cannot."""
    place = disk("size=1m,mode=755")
    if not place:
        return  # without mounts the cases above must do
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(place))
    there = build(TINY, find_compiler()).library
    subprocess.run(["mount", "-o", "remount,ro", place], check=True)
    assert build(TINY, find_compiler()).library == there and not said
    build(TINY | {"other.c": "int other;\n"}, find_compiler())
    assert build(TINY, find_compiler()).library == there
    the_line(said, "Read-only file system")
    with pytest.raises(ncgen.NcgenError, match="cannot be cleared: Read-only"):
        clear()


NOWHERE = """
import ncgen
kernels = ncgen.compile(ncgen.load("pendulum"), "c")
print(kernels.backend, kernels.library)
"""


def test_no_home_folder(tmp_path):
    """Nothing is made in the working directory, and the folder of the process goes with it."""
    environment = os.environ | {"NCGEN_CACHE_DIR": "~nobody-of-this-name/cache"}
    done = subprocess.run([sys.executable, "-c", NOWHERE], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    backend, library = done.stdout.split()
    assert backend == "c" and not Path(library).exists() and list(tmp_path.iterdir()) == []
    assert done.stderr.count("NCGEN_CACHE_DIR") == 1 and "no home folder" in done.stderr


def test_the_private_folder_goes_with_its_process(tmp_path):
    """Also that of a process which multiprocessing started; a forked one leaves its parent's where it is."""
    text = (
        "import multiprocessing, os, sys, ncgen\n"
        "def work(_):\n    return str(ncgen.compile(ncgen.load('pendulum'), 'c').library)\n"
        "if __name__ == '__main__':\n"
        "    own = work(0) if sys.argv[1] == 'fork' else ''\n"
        "    with multiprocessing.get_context(sys.argv[1]).Pool(1) as pool:\n"
        "        theirs = pool.map(work, [0])[0]\n        pool.close(); pool.join()\n"
        "    assert sys.argv[1] == 'spawn' or os.path.exists(own)\n    print(theirs)\n"
    )
    (tmp_path / "script.py").write_text(text)
    (tmp_path / "file").write_text("")
    environment = os.environ | {"NCGEN_CACHE_DIR": str(tmp_path / "file"), "TMPDIR": str(tmp_path)}
    for method in ("fork", "spawn"):
        command = [sys.executable, "script.py", method]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
        assert str(tmp_path / "ncgen-") in done.stdout
        assert sorted(p.name for p in tmp_path.iterdir() if p.name.startswith("ncgen-")) == []


def test_models_where_the_cache_cannot_be_used(tmp_path, monkeypatch, said):
    """From the model to the end of a run, with all libraries, in the folder that stands in."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(tmp_path / "file"))
    kernels = ncgen.compile(ncgen.load("fourbar"), "c")
    run = ncgen.simulate(kernels, 0.02, integrator="radau")
    assert run.engine == "emitted" and np.isfinite(run.q).all()
    the_line(said)


def test_everything_that_is_kept_has_a_digest(cache):
    """One digit changed: it is not what was kept."""
    keep("references", KEY, {"q": [0.1, 2.5], "doubt": float("inf")})
    assert kept("references", KEY) == {"q": [0.1, 2.5], "doubt": float("inf")}
    path = cache / "references" / f"{KEY}.json"
    path.write_bytes(path.read_bytes().replace(b"2.5", b"2.6"))
    assert kept("references", KEY) is None
    record = compiled(TINY).library.parent / "build.json"
    record.write_bytes(record.read_bytes().replace(b"-lm", b"-lq"))
    assert compiled(TINY).seconds > 0.0


def test_where_nothing_was_kept():
    assert recall(ncgen.load("pendulum"), "auto", "f" * 40) is None and cache_folder().name
    assert LIBRARY.endswith(".so")
