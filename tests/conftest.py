"""Fixtures shared by all tests: the examples' models and kernels, and a cache of their own."""

from __future__ import annotations

import fcntl
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

# Small matrices gain nothing from threads, and the test workers already use every core.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# More than half of the suite's time would be the compiler's. What is optimised is the same source: NCGEN_CFLAGS= python -m pytest
os.environ.setdefault("NCGEN_CFLAGS", "-O0")

import pytest  # noqa: E402

import ncgen  # noqa: E402
from ncgen.exchange.examples import example_module  # noqa: E402

pytest_plugins = ["times", "skips"]


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory) -> Path:
    """A folder of this test run that its workers have in common."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "gw" in base.name or "popen" in base.name else base


@pytest.fixture(scope="session", autouse=True)
def own_cache(run_folder):
    """Compiled libraries go to a folder of this test run, shared by its workers; or to one that several runs have in common."""
    with pytest.MonkeyPatch.context() as patch:
        folder = Path(os.environ.get("NCGEN_TEST_CACHE") or run_folder / "ncgen-cache")
        patch.setenv("NCGEN_CACHE_DIR", str(folder))
        yield folder


@pytest.fixture(scope="session")
def once(run_folder):
    """once(name, make): a folder, to be read only, that the first worker to ask for it fills by make(folder); others wait for it."""

    def get(name: str, make: Callable[[Path], object]) -> Path:
        folder, done = run_folder / "once" / name, run_folder / "once" / f"{name}.done"
        folder.parent.mkdir(exist_ok=True)
        with (folder.parent / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not done.exists():
                make(folder)
                done.touch()
        return folder

    return get


@pytest.fixture(scope="session")
def robot_tables():
    """The paper's tables as a module: `build(angles=…, form=…, scale=…)` makes the model."""
    return example_module("robot")


@pytest.fixture(scope="session")
def robot_model(robot_tables):
    return robot_tables.build()


@pytest.fixture(scope="session")
def robot(robot_model):
    """The robot's kernels in C."""
    return ncgen.compile(robot_model, backend="c")


@pytest.fixture(scope="session")
def robot_numpy(robot_model):
    return ncgen.compile(robot_model, backend="numpy")


@pytest.fixture
def heard() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt: who runs the tests in the background may ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def signals_may_raise() -> Iterator[None]:
    """For tests in which a signal's handler raises, anywhere: without the tracing that measures coverage. That holds a lock now and then,
    which an exception raised there would leave held, and the next line to be traced would wait for ever.
    """
    tracer = sys.gettrace()
    sys.settrace(None)
    yield
    sys.settrace(tracer)
