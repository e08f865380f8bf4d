"""Compiled kernels in a process: several libraries, several threads, wrong arguments."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import ncgen
from ncgen import Model
from ncgen.errors import NcgenError

THREADS, CALLS = 4, 200


def pendulum(name: str, length: float) -> Model:
    model = Model(name)
    model.distance(model.point("A", (0, 0), fixed=True), model.point("B", (length, 0)))
    return model


def test_several_models_live_side_by_side():
    """Libraries of different models in one process do not disturb each other, whatever is called between."""
    lengths = (1.0, 2.0, 4.0)
    kernels = [ncgen.compile(pendulum(f"side{k}", length), backend="c") for k, length in enumerate(lengths)]
    for _ in range(2):
        for length, each in zip(lengths, kernels):
            assert each.phi(each.q0 + [1.0, 0.0])[0] == pytest.approx(((length + 1) ** 2 - length**2) / (2 * length))


FORGETFUL = """
import gc, ncgen
for k in (1, 2, 3):
    model = ncgen.Model(f"forgotten{k}")
    model.distance(model.point("A", (0, 0), fixed=True), model.point("B", (k, 0)))
    kernels = ncgen.compile(model, backend="c")
    print(kernels.phi(kernels.q0 + [1.0, 0.0])[0])
    del kernels
    gc.collect()
"""


def test_models_can_be_forgotten():
    """A library may be dropped before the next one is loaded."""
    done = subprocess.run([sys.executable, "-c", FORGETFUL], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert list(map(float, done.stdout.split())) == pytest.approx([1.5, 1.25, 7 / 6])


TWO_COMPILERS = """
import os, shutil
from pathlib import Path
import numpy as np
import ncgen

compiler = shutil.which("cc") or shutil.which("gcc")
told = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
os.environ["CC"] = f"{compiler} -DNCGEN_LANES={4 if 'avx512f' in told else 8}"  # not what this processor takes


def motions():
    k = ncgen.compile(ncgen.load("fourbar"), backend="c")
    speeds = np.linspace(1.0, 5.0, 5)[:, None]
    many = ncgen.simulate(k, 0.1, zd0=speeds, points=3, rtol=1e-10)
    ends = lambda q, qd: (q[-1, 0], np.r_[np.zeros((len(q) - 1, k.n)), [np.eye(k.n)[0]]], None)
    slopes = ncgen.gradient(k, 0.1, 20, ends, zd0=speeds).derivatives
    along = ncgen.sensitivities(k, 0.1, 20, zd0=[1.0]).q_by[-1]
    return many.q[:, -1], slopes, along, k.batch.gamma(np.tile(k.q0, (5, 1)), np.ones((5, k.n)))


first = motions()
os.environ["CC"] = compiler
for before, after in zip(first, motions(), strict=True):
    print(np.abs(before - after).max() <= 1e-9 * np.abs(before).max())
"""


def test_vectors_are_as_wide_as_those_of_the_library_that_calls():
    """What moves many states is loaded once in a process. A mechanism that another compiler is taken for, whose vectors would be of another
    width (so did one that had lost -march=native), is written for that width: it ended the process."""
    done = subprocess.run([sys.executable, "-c", TWO_COMPILERS], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["True"] * 4


THREADED = """
import gc, os, ncgen, numpy as np
for k in (1, 2, 3):
    model = ncgen.Model(f"threaded{k}")
    model.distance(model.point("A", (0, 0), fixed=True), model.point("B", (k, 0)))
    kernels = ncgen.compile(model, backend="c")
    batch = kernels.batch
    batch.threads = None
    batch.phi(np.tile(kernels.q0, (1000, 1)))
    del batch, kernels
    gc.collect()
    mapped = "gomp" in open("/proc/self/maps").read() or "libomp" in open("/proc/self/maps").read()
    print(len(os.listdir("/proc/self/task")), mapped)
"""


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="looks at the process through /proc")
def test_threads_keep_their_code():
    """Threads of OpenMP wait until the process ends, so their library stays, and the next batch finds the same threads."""
    done = subprocess.run([sys.executable, "-c", THREADED], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    threads, mapped = zip(*(line.split() for line in done.stdout.splitlines()))
    assert int(threads[0]) == 1 or set(mapped) == {"True"}
    assert len(set(threads)) == 1


@pytest.fixture(scope="module")
def motions(robot_numpy):
    """Positions and velocities for every call of every thread, and {kernel: right values}."""
    rng = np.random.default_rng(5)
    q = robot_numpy.q0 + rng.uniform(-0.1, 0.1, (THREADS, CALLS, robot_numpy.n))
    qd = rng.uniform(-1, 1, q.shape)
    return q, qd, {name: robot_numpy.values(name, 0.0, q, qd, None) for name in robot_numpy.programs.programs}


def wrong_calls(kernels, thread: int, motions) -> list[str]:
    """Call every kernel with all positions of one thread; which of the results are wrong."""
    q, qd, expected = motions
    wrong = []
    for call in range(CALLS):
        for name, right in expected.items():
            values = kernels.values(name, 0.0, q[thread, call], qd[thread, call], None)
            if np.max(np.abs(values - right[thread, call])) > 1e-12 * np.max(np.abs(right)):
                wrong.append(f"thread {thread}, call {call}: {name}")
    return wrong


def in_threads(work) -> list:
    """work(0), work(1) … at the same time; their results, and the first error if there is one."""
    together = threading.Barrier(THREADS)

    def start(thread: int):
        together.wait(60)
        return work(thread)

    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(start, range(THREADS)))


def test_threads_load_and_call_at_once(robot_model, motions):
    """Four threads load the same model at the same time, and each gets the values of its own positions."""
    sources = ncgen.generate(robot_model)
    assert in_threads(lambda k: wrong_calls(ncgen.compile(sources, backend="c"), k, motions)) == [[]] * THREADS


def test_one_object_serves_several_threads(robot, motions):
    """The same kernels, called from four threads at once, give each its own values."""
    assert in_threads(lambda k: wrong_calls(robot, k, motions)) == [[]] * THREADS


def test_wrong_values_would_be_seen(robot, motions):
    """The check above finds a thread that gets another one's values."""
    q, qd, expected = motions
    assert len(wrong_calls(robot, 0, (q[::-1], qd, expected))) >= CALLS


def test_results_are_copies(robot):
    """What a kernel returned stays as it is when the kernel is called again, and inputs are not written to."""
    q = robot.q0.copy()
    first = robot.phi_q(q).data
    kept = first.copy()
    robot.phi_q(q + 0.1)
    assert (first == kept).all() and (q == robot.q0).all()


@pytest.mark.parametrize("backend", ["c", "numpy"])
def test_wrong_lengths_are_named(robot, robot_numpy, backend):
    """A q of the wrong length is refused in one line that names kernel, argument and both sizes."""
    kernels = {"c": robot, "numpy": robot_numpy}[backend]
    with pytest.raises(NcgenError, match=r"robot\.phi: q has shape \(45,\).*36 free coordinates") as caught:
        kernels.phi(np.zeros(45))
    assert "\n" not in str(caught.value)
    with pytest.raises(NcgenError, match=r"robot\.gamma: qd has shape \(0,\)"):
        kernels.gamma(kernels.q0, np.zeros(0))


@pytest.mark.parametrize("q", [np.zeros((2, 36)), np.zeros(36, dtype=complex)], ids=["batch", "complex"])
def test_c_takes_one_real_position(robot, q):
    """What only the NumPy backend can do is refused by name, not half done."""
    with pytest.raises(NcgenError) as caught:
        robot.phi(q)
    assert "numpy" in str(caught.value).lower() and "\n" not in str(caught.value)


def test_backends_agree_on_batches(robot, robot_numpy):
    """NumPy's batches are what C computes one by one."""
    q = robot.q0 + np.linspace(-0.1, 0.1, 3)[:, None]
    np.testing.assert_allclose(robot_numpy.phi(q), [robot.phi(each) for each in q], rtol=1e-12, atol=1e-14)
