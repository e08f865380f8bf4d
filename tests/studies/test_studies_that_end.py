"""Studies that are ended: by kill -9, by Ctrl-C, by a full disk, by the loss of workers. What they had is kept, and they go on."""

from __future__ import annotations

import io
import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
import small_study

import ncgen
from ncgen.archives import packed
from ncgen.studies.study_folder import Folder

PROGRAM = Path(small_study.__file__)
COUNT = 1500


@pytest.fixture(scope="module")
def uninterrupted():
    return small_study.run(None, COUNT)


class Forked:
    """A process like one of `subprocess`, which has imported everything already: a copy of this one."""

    def __init__(self, folder: Path, count: int, limit: int | None) -> None:
        reading, writing = os.pipe()
        self.pid, self.returncode = os.fork(), None
        if self.pid:
            os.close(writing)
            self.stdout = os.fdopen(reading)
            return
        status = 70
        signal.alarm(60)
        sys.settrace(None)  # as `signals_may_raise`
        try:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            sys.stdout = os.fdopen(writing, "w")
            if limit is not None:
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
            status = small_study.main(str(folder), count, None, threads=1)  # a fork has no other threads
            sys.stdout.flush()
        finally:
            os._exit(status)

    def send_signal(self, number: int) -> None:
        os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def communicate(self, timeout: float = 0.0) -> tuple[str, None]:
        said = self.stdout.read()
        self.stdout.close()
        self.returncode = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return said, None


Process = Forked | subprocess.Popen


def start(folder: Path, workers: int | str = 0, limit: int | None = None, count: int = COUNT) -> Process:
    """A study that will be ended; one that starts processes itself is a program of its own."""
    if not workers:
        return Forked(folder, count, limit)
    arguments = [sys.executable, str(PROGRAM), str(folder), str(count), str(workers)]
    heard = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)  # noqa: E731
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, preexec_fn=heard)


def first_told(process: Process, least: int) -> None:
    """Wait until so many variants are done."""
    assert process.stdout
    for line in process.stdout:
        if line.strip().isdigit() and int(line) >= least:
            return
    raise AssertionError("the study ended before")


def assert_same(found, expected) -> None:
    """All variants once, with the same bits."""
    assert found.complete and np.array_equal(found.variant, expected.variant)
    for name in expected.keys():
        assert np.array_equal(found[name], expected[name]), name


def test_kill_9(tmp_path, uninterrupted):
    """Three times at random moments after its first results."""
    folder, wait, useful = tmp_path / "swing", random.Random(1), 0
    for _ in range(3):
        process = start(folder)
        first_told(process, 0 if folder.exists() else 1)
        time.sleep(wait.uniform(0, 0.2))
        process.kill()
        process.communicate()
        useful += len(ncgen.read(folder)) < COUNT
    assert useful >= 1
    assert_same(small_study.run(str(folder), COUNT), uninterrupted)
    assert not [*folder.glob(".variants-*")]


@pytest.mark.slow
def test_kill_9_twenty_times(tmp_path):
    expected = small_study.run(None, 20 * COUNT)
    folder, wait = tmp_path / "swing", random.Random(0)
    for _ in range(20):
        process = start(folder, count=20 * COUNT)
        first_told(process, 0)
        time.sleep(wait.uniform(0, 1.5))
        process.kill()
        process.communicate()
    assert_same(small_study.run(str(folder), 20 * COUNT), expected)


@pytest.mark.parametrize("workers", [0, *(pytest.param(workers, marks=pytest.mark.slow) for workers in (2, "local"))])
def test_ctrl_c_ends_soon(tmp_path, workers, uninterrupted):
    """Cleanly, with what was done in the folder, and no process left; whoever pressed it waits for no worker's end."""
    if workers == "local":
        pytest.importorskip("distributed")
    folder = tmp_path / "swing"
    process = start(folder, workers, count=200 * COUNT)
    first_told(process, 65)  # the first chunk is written
    pressed = time.perf_counter()
    process.send_signal(signal.SIGINT)
    assert process.stdout
    said = next(line for line in process.stdout if not line.strip().isdigit())
    spent = time.perf_counter() - pressed
    rest, _ = process.communicate(timeout=20)
    print(f"Ctrl-C with {workers or 'no'} workers: {spent:.3f} s, the process {time.perf_counter() - pressed:.3f} s")
    assert process.returncode == 3 and "KeyboardInterrupt" in said and "Traceback" not in rest
    assert spent < 1.0  # on a machine that does other things too
    found = ncgen.read(folder)
    assert 0 < len(found) < 200 * COUNT and found.ok.all()


def test_a_full_disk(tmp_path, uninterrupted):
    """One line; what was written can be read, and the study goes on where there is room."""
    folder = tmp_path / "swing"
    process = start(folder, limit=5_500)  # the first chunk, and none of twice its size
    said, _ = process.communicate(timeout=120)
    last = said.splitlines()[-1]
    assert process.returncode == 3 and f"{folder} takes no more results: File too large; make room" in last and "Traceback" not in said
    before = ncgen.read(folder)
    assert 0 < len(before) < COUNT and not before.complete and "psi" in before.table()
    assert_same(small_study.run(str(folder), COUNT), uninterrupted)


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_processes_and_lost_ones(tmp_path, workers, uninterrupted):
    """Workers are killed while they work: nothing is lost, nothing comes twice, and the bits are those of one process."""
    killed: list[int] = []

    def is_worker(child: int) -> bool:
        try:
            return "spawn_main" in Path(f"/proc/{child}/cmdline").read_text()
        except (FileNotFoundError, ProcessLookupError):  # it has ended since it was listed
            return False

    def kill_one(done: int, *_: object) -> None:
        found = [c for c in map(int, Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()) if is_worker(c)]
        if done and not killed and found:
            killed.append(found[0])
            os.kill(found[0], signal.SIGKILL)

    assert_same(small_study.run(str(tmp_path / "swing"), COUNT, workers, progress=kill_one), uninterrupted)
    assert killed


@pytest.mark.slow
def test_a_dask_cluster_that_loses_workers(uninterrupted):
    """As with processes; the scheduler hands lost chunks out again."""
    distributed = pytest.importorskip("distributed")
    expected, killed = small_study.run(None, 20 * COUNT), []
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:

        def kill_one(done: int, *_: object) -> None:
            if len(killed) < 3 and done > 5 * COUNT * (1 + len(killed)):
                killed.append(next(iter(cluster.workers.values())).process.process.pid)
                os.kill(killed[-1], signal.SIGKILL)

        assert_same(small_study.run(None, 20 * COUNT, cluster.scheduler_address, progress=kill_one), expected)
    assert len(killed) == 3


def test_an_executor_of_ones_own(uninterrupted):
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(3) as executor:
        assert_same(small_study.run(None, COUNT, executor), uninterrupted)


def test_what_a_study_does_raises_where_it_is_wrong():
    """A mistake in what is sent is no lost worker."""
    from ncgen.studies.engines import compute

    with pytest.raises(Exception, match="pickle|load"):
        compute("none", b"no study", 0, np.empty((0, 0)))


def test_folders_are_guarded(tmp_path):
    """Another study's, another version's, one that is in use, one that is none, and broken files."""
    folder = tmp_path / "swing"
    found = small_study.run(str(folder), 100)
    with pytest.raises(ncgen.NcgenError, match="it holds another study; give another folder"):
        small_study.run(str(folder), 101)
    with Folder.at(folder).held(), pytest.raises(ncgen.NcgenError, match="another process is at work in it"):
        small_study.run(str(folder), 100)
    file = next(folder.glob("variants-*.npz"))
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(ncgen.NcgenError, match="cannot be read"):
        ncgen.read(folder).table()
    assert_same(small_study.run(str(folder), 100), found)
    manifest = folder / "study.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"ncgen": "0.0.1"}))
    with pytest.raises(ncgen.NcgenError, match="results of ncgen 0.0.1"):
        small_study.run(str(folder), 100)
    for text, said in (("{", "no manifest"), ("{}", "no manifest"), ("[]", "no manifest")):
        manifest.write_text(text)
        with pytest.raises(ncgen.NcgenError, match=said):
            ncgen.read(folder)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "letter.txt").write_text("dear")
    with pytest.raises(ncgen.NcgenError, match="it is no folder of a study, and not empty"):
        small_study.run(str(tmp_path / "other"), 100)
    with pytest.raises(ncgen.NcgenError, match="there is no such"):
        ncgen.read(tmp_path / "nothing")


def test_the_lock_of_a_folder_is_no_link(tmp_path):
    """A link in a folder from elsewhere does not empty what it leads to."""
    folder, letter = tmp_path / "swing", tmp_path / "letter.txt"
    small_study.run(str(folder), 10)
    letter.write_text("dear")
    (folder / ".lock").unlink()
    (folder / ".lock").symlink_to(letter)
    with pytest.raises(ncgen.NcgenError, match=r"\.lock: it cannot be locked: it is a symbolic link; remove it"):
        small_study.run(str(folder), 10)
    assert letter.read_text() == "dear"


def flipped(data: bytes, name: str) -> bytes:
    """An archive with one bit of the last number of a member turned."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        member = archive.getinfo(f"{name}.npy")
        text = archive.read(member)
    place = data.index(text) + len(text) - 1
    return data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]


def shortened(data: bytes, name: str) -> bytes:
    """An archive whose checksums are right, and in which a column lacks its last number, or has one where it should have none."""
    members = dict(np.load(io.BytesIO(data)))
    return packed(members | {name: members[name][:-1] if len(members[name]) else np.array(["failed"])})


def without(data: bytes, name: str) -> bytes:
    members = dict(np.load(io.BytesIO(data)))
    return packed({key: value for key, value in members.items() if key != name})


def test_a_folder_of_before_is_read(tmp_path):
    """Its files call messages and the variants that have them otherwise."""
    folder, former = tmp_path / "swing", {"message variants": "said of", "message texts": "what was said"}
    found = small_study.run(str(folder), 100)
    for file in folder.glob("variants-*.npz"):
        with np.load(file) as archive:
            contents = {former.get(name, name): archive[name] for name in archive.files}
        file.write_bytes(packed(contents))
    older = ncgen.read(folder)
    assert older.complete and older.messages == found.messages
    assert_same(small_study.run(str(folder), 100), found)


@pytest.mark.parametrize("damage", [flipped, shortened, without])
@pytest.mark.parametrize("name", ["psi", "length", "steps", "ok", "message texts"])
def test_a_damaged_column_is_made_again(tmp_path, damage, name):
    """Whichever it is: its file does not count as done, reading it is refused, and the study makes it again and says so."""
    folder = tmp_path / "swing"
    found = small_study.run(str(folder), 100)
    file = sorted(folder.glob("variants-*.npz"))[-1]
    file.write_bytes(damage(file.read_bytes(), name))
    damaged = ncgen.read(folder)
    assert not damaged.complete
    with pytest.raises(ncgen.NcgenError, match=f"{file.name}: it cannot be read .*; start the study again"):
        damaged.failures if name == "message texts" else damaged[name]
    with pytest.warns(UserWarning, match=f"a file is not whole, {file.name} .*computed again"):
        assert_same(small_study.run(str(folder), 100), found)


@pytest.mark.parametrize(
    "change, said",
    [
        ({"variants": 10**18}, "no manifest of a study .10{18} variants of shape .100."),
        ({"variants": 10**18, "shape": [10**18]}, "no manifest of a study .10{18} variants"),
        ({"variants": 10**15, "shape": [10**15]}, "a manifest in which variants is 10{15} instead of 100"),
        ({"shape": [10, 10]}, r"a manifest in which shape is \[10, 10\] instead of \[100\]"),
        ({"shape": [10**300] * 1000}, "no manifest of a study .100 variants of shape"),
        ({"kept": ["psi", "steps"]}, "a manifest in which kept is"),
        ({"names": ["length", "length"]}, "no manifest of a study .two columns have one name"),
        ({"names": [["length"], 3]}, "no manifest of a study .names has something else"),
        ({"times": [[1.0], [2.0, 3.0]]}, "no manifest of a study .times has something else"),
        ({"times": [float("nan")]}, "no manifest of a study .a time is not finite"),
        ({"variants": True}, "no manifest of a study .variants is True"),
    ],
)  # fmt: skip
def test_a_manifest_is_compared_with_what_is_asked(tmp_path, change, said):
    """In one line and at once: nothing goes on for as many variants as a text says."""
    folder = tmp_path / "swing"
    small_study.run(str(folder), 100)
    manifest = folder / "study.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | change))
    began = time.process_time()
    with pytest.raises(ncgen.NcgenError, match=said) as caught:
        small_study.run(str(folder), 100)
    assert "\n" not in str(caught.value) and time.process_time() - began < 20


def test_brackets_and_pipes_for_manifests(tmp_path):
    """What a reader of JSON is no match for, and what it would wait for."""
    folder = tmp_path / "swing"
    folder.mkdir()
    (folder / "study.json").write_text("[" * 100_000)
    for make in (lambda: None, lambda: os.mkfifo(folder / "study.json"), lambda: (folder / "study.json").mkdir()):
        make()
        with pytest.raises(ncgen.NcgenError, match="no manifest of a study|it is a pipe|it is a folder"):
            ncgen.read(folder)
        path = folder / "study.json"
        path.rmdir() if path.is_dir() else path.unlink()


def test_files_that_overlap(tmp_path):
    """A copy under another name is refused where it is read, and removed where the study goes on."""
    folder = tmp_path / "swing"
    found = small_study.run(str(folder), 100)
    file = sorted(folder.glob("variants-*.npz"))[-1]
    copy = folder / "variants-0000000000000050-0000000000000090.npz"
    copy.write_bytes(file.read_bytes())
    (folder / "variants-0000000000000200-0000000000000210.npz").write_bytes(file.read_bytes())
    with pytest.raises(ncgen.NcgenError, match="another file has some of its variants|no such variants"):
        len(ncgen.read(folder))
    with pytest.warns(UserWarning, match="files are not whole"):
        assert_same(small_study.run(str(folder), 100), found)


def test_a_file_that_another_process_writes_stays(tmp_path):
    """What is unfinished is removed only by whoever holds the folder."""
    folder = tmp_path / "swing"
    small_study.run(str(folder), 100)
    (folder / ".variants-half").write_text("half")
    with Folder.at(folder).held(), pytest.raises(ncgen.NcgenError, match="another process is at work"):
        small_study.run(str(folder), 100)
    assert (folder / ".variants-half").exists()
    small_study.run(str(folder), 100)
    assert not (folder / ".variants-half").exists()
