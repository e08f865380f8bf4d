"""The cache of libraries: whole entries or none, whoever builds, dies or interferes."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from tiny import TINY

import ncgen
from ncgen.errors import NcgenError
from ncgen.toolchain.cache import RECORD, build, clear, entries
from ncgen.toolchain.cache_location import ABANDONED_SECONDS, cache_folder, unsealed
from ncgen.toolchain.compilers import FLAGS, LIBRARY, Compiler, find_compiler


def folders(cache: Path) -> list[str]:
    return sorted(path.name for path in cache.iterdir())


def wait_for(path: Path) -> str:
    """The content of a file that another process is about to write."""
    deadline = time.monotonic() + 60
    while not (path.is_file() and path.read_text()):
        assert time.monotonic() < deadline, f"{path} did not appear"
        time.sleep(0.01)
    return path.read_text()


def energy_at(sources, height: float) -> float:
    """Load the pendulum in C and take its energy with the bob raised."""
    kernels = ncgen.compile(sources, backend="c")
    return float(kernels.energy(kernels.q0 + [0.0, height], 0 * kernels.q0)[1])


def test_a_library_is_built_once(cache):
    """The first call compiles, the second finds the same file; the entry holds sources, library and record."""
    first, second = build(TINY, find_compiler()), build(TINY, find_compiler())
    assert first.seconds > 0.0 and second.seconds == 0.0
    assert first.library == second.library and first.library.parent.parent == cache
    assert ctypes.CDLL(str(first.library)).tiny() == 7
    assert {path.name for path in first.library.parent.iterdir()} == {*TINY, LIBRARY, RECORD}
    assert unsealed(first.library.parent / RECORD)["command"][1 : 1 + len(FLAGS)] == list(FLAGS)


def test_an_entry_appears_at_once(cache, monkeypatch):
    """It is made by one rename of a folder that has everything; before, nothing has its name."""
    renamed = []

    def watch(source, target, rename=os.rename):
        renamed.append(({path.name for path in Path(source).iterdir()}, Path(target).exists()))
        rename(source, target)

    monkeypatch.setattr(os, "rename", watch)
    build(TINY, find_compiler())
    assert renamed == [({*TINY, LIBRARY, RECORD}, False)]


def test_eight_builders_make_one_entry(cache, scripted, child, pendulum_sources, tmp_path):
    """Eight processes start together; all get right numbers, one entry is left, and no temporary folder."""
    scripted(f'echo started >> {tmp_path}/log; sleep 0.3; exec $CC "$@"')
    barrier = multiprocessing.get_context("fork").Barrier(8)

    def work(height):
        barrier.wait(30)
        return energy_at(pendulum_sources, height)

    workers = [child(work, k / 8) for k in range(8)]
    assert [worker.result() for worker in workers] == pytest.approx([9.81 * k / 8 for k in range(8)])
    assert folders(cache) == [*(entry.key for entry in entries()), "interfaces"] and len(entries()) == 1
    assert (tmp_path / "log").read_text().count("started") > 1, "the builders did not meet"


def test_a_killed_builder_leaves_no_entry(cache, scripted, child, pendulum_sources, tmp_path):
    """SIGKILL while the compiler runs: nothing is published, and the next build succeeds."""
    slow, started = tmp_path / "slow", tmp_path / "started"
    scripted(f'if [ -f {slow} ]; then echo $$ > {started}; exec sleep 60; fi; exec $CC "$@"')
    slow.touch()
    builder = child(energy_at, pendulum_sources, 1.0)
    compiler = int(wait_for(started))
    os.kill(builder.process.pid, signal.SIGKILL)
    assert builder.result() == -signal.SIGKILL
    os.kill(compiler, signal.SIGKILL)
    assert entries() == [] and len(folders(cache)) == 1
    slow.unlink()
    assert child(energy_at, pendulum_sources, 1.0).result() == pytest.approx(9.81)
    assert len(entries()) == 1


def test_abandoned_builds_are_cleared_in_time(cache):
    """clear() leaves a build that may still be running, and removes one that nobody can be working on."""
    names = ["ncgen-building-recent_0", "ncgen-building-old_folder", "building-blocks", "ncgen-building-old_foam"]
    past = time.time() - ABANDONED_SECONDS - 60
    for name in names:
        (cache / name).mkdir(parents=True)
        (cache / name / "file").touch()
        if name != names[0]:
            os.utime(cache / name, (past, past))
    (cache / "programs").mkdir()
    (cache / "programs" / "ncgen-building-abcdefgh").touch()
    os.utime(cache / "programs" / "ncgen-building-abcdefgh", (past, past))
    assert clear() == 0
    assert folders(cache) == ["building-blocks", "ncgen-building-old_folder", "ncgen-building-recent_0"]


def test_abandoned_builds_go_with_the_next_one(cache):
    """Nobody has to clear the cache to be rid of what killed processes left in it."""
    abandoned = cache / "ncgen-building-abandone"
    abandoned.mkdir(parents=True)
    past = time.time() - ABANDONED_SECONDS - 60
    os.utime(abandoned, (past, past))
    build(TINY, find_compiler())
    assert not abandoned.exists()


def test_whatever_matters_is_in_the_key(cache):
    """Another text, file name, flag, library, compiler or compiler's option is another entry."""
    compiler = find_compiler()
    keys = [
        build(TINY, compiler).library,
        build({**TINY, "tiny.h": TINY["tiny.h"].replace("7", "8")}, compiler).library,
        build({"small.c": TINY["tiny.c"], "tiny.h": TINY["tiny.h"]}, compiler).library,
        build(TINY, compiler, (*FLAGS, "-DUNUSED")).library,
        build(TINY, compiler, FLAGS, ()).library,
        build(TINY, Compiler((*compiler.command, "-g"), compiler.identity)).library,
        build(TINY, Compiler(compiler.command, compiler.identity + "+")).library,
    ]
    assert len(set(keys)) == len(keys) == len(entries())


def test_a_changed_compiler_is_another_compiler(scripted):
    """The same path with another program behind it is told apart; the same program is the same."""
    first = scripted('exec $CC "$@"')
    assert find_compiler().identity == first.identity
    assert scripted('exec $CC  "$@"').identity != first.identity


DAMAGES = {
    "empty": (lambda data: b"", False),
    "cut in the header": (lambda data: data[:64], False),
    "text": (lambda data: b"hello", False),
    "cut in the code": (lambda data: data[:4096], True),
    "cut in half": (lambda data: data[: len(data) // 2], True),
    "zeros": (lambda data: data[:1000] + bytes(len(data) - 1000), True),
}


@pytest.mark.parametrize(
    "damage",
    [pytest.param(damage, id=name) for name, (damage, _) in DAMAGES.items()],
)
def test_a_damaged_library_is_not_run(cache, child, pendulum_sources, damage):
    """A library that lost its content is built again, or refused in one line that says what to do: no crash."""
    library = build(pendulum_sources.c, find_compiler()).library
    library.write_bytes(damage(library.read_bytes()))
    result = child(energy_at, pendulum_sources, 1.0).result()
    if isinstance(result, NcgenError):
        assert str(library) in str(result) and "ncgen cache --clear" in str(result) and "\n" not in str(result)
    else:
        assert result == pytest.approx(9.81)


def test_half_an_entry_is_replaced(cache):
    """An entry whose library is gone, as after a clear() that was interrupted, is built again."""
    library = build(TINY, find_compiler()).library
    library.unlink()
    assert build(TINY, find_compiler()).library.is_file()


def test_where_the_cache_is(monkeypatch, tmp_path):
    """$NCGEN_CACHE_DIR if it is set, with ~ for the home folder; else the user's cache folder."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.setenv("NCGEN_CACHE_DIR", "~/mine")
    assert cache_folder() == tmp_path / "mine"
    monkeypatch.delenv("NCGEN_CACHE_DIR")
    assert cache_folder().name == "ncgen" and cache_folder() != tmp_path / "mine"


def test_listing_and_clearing_leave_foreign_folders(cache):
    """Only folders with a library and its record are entries; clear() removes those and nothing else."""
    assert entries() == [] and clear() == 0
    build(TINY, find_compiler())
    foreign = {"photos": "cat.jpg", "library": LIBRARY, "record": RECORD, "programs": "mine.py", "references": "letter.json", "0" * 40: "x"}
    for name, file in foreign.items():
        (cache / name).mkdir(exist_ok=True)
        (cache / name / file).write_text("mine")
    (cache / "loose.txt").write_text("mine")
    (entry,) = entries()
    assert entry.sources == ("tiny.c",) and 0 <= entry.age < 60
    assert entry.size == sum(path.stat().st_size for path in (cache / entry.key).iterdir())
    assert clear() == 1
    assert folders(cache) == sorted([*foreign, "loose.txt"])
    assert all((cache / name / file).read_text() == "mine" for name, file in foreign.items())


def test_entries_are_listed_newest_first(cache):
    """The age is that of the build."""
    old, new = (build({"a.c": f"int a{k}(void) {{ return {k}; }}\n"}, find_compiler()).library.parent for k in range(2))
    past = time.time() - 3600
    os.utime(old / RECORD, (past, past))
    assert [entry.key for entry in entries()] == [new.name, old.name]
    assert entries()[1].age == pytest.approx(3600, abs=60)


def test_entries_can_be_read_by_others(cache):
    """A published entry is open to read, unlike the temporary folder it was built in."""
    assert build(TINY, find_compiler()).library.parent.stat().st_mode & 0o777 == 0o755


def test_kernels_survive_the_cache(cache, pendulum_sources):
    """Libraries that are loaded go on working when the cache is cleared."""
    kernels = ncgen.compile(pendulum_sources, backend="c")
    assert clear() == 1
    np.testing.assert_allclose(kernels.force(kernels.q0, 0 * kernels.q0), [0.0, -9.81])


# -- many at once, and some that die ---------------------------------------------------------------------------------------------


def pendulum_of(length: float):
    model = ncgen.Model("many")
    pivot, bob = model.point("pivot", (0, 0), fixed=True), model.point("bob", (length, 0))
    model.body("bob", points=[bob], mass=1.0)
    model.distance(pivot, bob)
    model.gravity((0, -9.81, 0))
    return model


def phi_of(length: float, *_) -> float:
    """From a model to a number: (d² − L²) / 2 L at d = 2 L, which is 1.5 L."""
    kernels = ncgen.compile(pendulum_of(length), backend="c")
    return float(kernels.phi(2 * kernels.q0)[0])


def test_eight_processes_and_three_models(cache, child):
    """The same and different models at once: every process has its own numbers, every model one library and one program, and so has every
    structure: 1 is one of its own, 2 and 3 share another."""
    lengths = [1.0 + k % 3 for k in range(8)]
    workers = [child(phi_of, length) for length in lengths]
    assert [worker.result() for worker in workers] == pytest.approx([1.5 * length for length in lengths])
    assert len(entries()) == 3 and len(list((cache / "programs").iterdir())) == 3 + 2
    assert len(folders(cache)) == 3 + len(["generators", "interfaces", "programs"])


def killed(cache: Path, child, rounds: int, seed: int) -> None:
    """Pairs of processes build the same library; one or both are killed at a random moment of what a build takes."""
    rng = np.random.default_rng(seed)
    start = time.perf_counter()
    assert child(phi_of, 0.5).result() == pytest.approx(0.75)
    whole = time.perf_counter() - start
    for k in range(rounds):
        length = 1.0 + k // 2  # every second one finds what the first has left
        pair = [child(phi_of, length), child(phi_of, length)]
        time.sleep(rng.uniform(0, whole))
        for worker in pair[: rng.integers(1, 3)]:
            os.kill(worker.process.pid, signal.SIGKILL)
        for worker in pair:
            assert worker.result() in (pytest.approx(1.5 * length), -signal.SIGKILL)
    for length in {1.0 + k // 2 for k in range(rounds)}:
        assert phi_of(length) == pytest.approx(1.5 * length)
    past = time.time() - ABANDONED_SECONDS - 60
    for path in (*cache.glob("ncgen-building-*"), *cache.glob("*/ncgen-building-*")):
        os.utime(path, (past, past))
    assert clear() == 1 + len({k // 2 for k in range(rounds)})
    assert folders(cache) == [], "in a day nothing is left of those that died"


def test_builders_that_are_killed(cache, child):
    """SIGKILL at ten random moments: nothing is lost, wrong, or left for ever."""
    killed(cache, child, 10, 1)


@pytest.mark.slow
def test_many_builders_that_are_killed(cache, child):
    killed(cache, child, 200, 2)
