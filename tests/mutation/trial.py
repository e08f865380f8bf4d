"""Tests run one after the other on a copy of the repository until one fails, in a process of their own.

The process is a fork of this one, which has imported what tests need beside ncgen, so it begins at once.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import pytest

WARM = (
    "cffi", "hypothesis", "jinja2", "matplotlib.figure", "mpmath", "numpy.testing", "rich.console", "scipy.integrate", "scipy.linalg",
    "scipy.optimize", "scipy.sparse.linalg", "sympy", "typer.testing",
)  # fmt: skip

ENDLESS = 30.0
"""Seconds of the processor, far longer than any ordinary test takes, after which one that is still running notices the fault."""

WAITING = 300.0
"""Seconds after which a test that waits for something that never comes notices it."""

MODULES = 6
"""Of tests that are collected at a time."""

OPTIONS = ("-x", "-q", "-o", "addopts=", "-m", "not slow", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:cov")


def warm_up() -> None:
    """Import what tests need beside ncgen."""
    for name in WARM:
        importlib.import_module(name)


class Watch:
    """A plugin of pytest: tests in the order in which they are promising, until one fails or time is up; which, is written to a file.

    end: when time is up, on the clock of `_spent`
    """

    def __init__(self, tests: list[str], end: float, told: Path, is_in_c: bool) -> None:
        self.rank = {test: rank for rank, test in enumerate(tests)}
        self.end, self.told, self.is_in_c = end, told, is_in_c
        self.failed = False

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Only what was asked for, a whole module where its name was given."""
        if self.is_in_c:  # what is derived from models is the same whatever the C library does, so it is recalled as of sound sources
            from ncgen.mechanism import generator_identity, runtime_library

            generator_identity.package_files = partial(_sound_files, generator_identity.package_files)
            runtime_library.shared = lambda _, make: make()  # the library itself is not, since it is what has the fault
        ranks = {item: self.rank.get(item.nodeid, self.rank.get(item.nodeid.partition("::")[0])) for item in items}
        items[:] = sorted((item for item in items if ranks[item] is not None), key=lambda item: ranks[item] or 0)

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.told.write_text(nodeid)
        signal.setitimer(signal.ITIMER_PROF, ENDLESS)  # what is done at its end: the process ends by the signal SIGPROF

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._take(report)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        self._take(report)

    def _take(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        if report.failed:
            self.failed = True
            self.told.write_text(report.nodeid)

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0)
        if not self.failed and _spent() > self.end:
            os._exit(0)


def _sound_files(package_files: Callable[..., list[str]], *packages: str) -> list[str]:
    """Files of packages of ncgen, without the C library."""
    return package_files(*(package for package in packages if package != "runtime"))


def _spent() -> float:
    """Seconds of the processor, with those of processes that have ended."""
    return sum(os.times()[:4])


def failing(copy: Path, tests: list[str], seconds: float, is_in_c: bool) -> str:
    """The first of some tests that fails on a copy of the repository, before they have taken `seconds` of the processor; or nothing."""
    told = copy.parent / "told"
    told.write_text("the imports")
    process = os.fork()
    if not process:
        _run(copy, tests, seconds, told, is_in_c)
    code = _exit_code(process, WAITING + 20 * seconds)
    if code in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
        return ""
    endings = {None: ", which waits", -signal.SIGPROF: ", which does not end"}
    return told.read_text() + (endings.get(code) or ("" if code is None or code > 0 else f", signal {-code}"))


def _exit_code(process: int, patience: float) -> int | None:
    """How a process ends; None where it does not within so many seconds. What it has started ends with it."""
    end = time.monotonic() + patience
    try:
        while time.monotonic() < end:
            done, status = os.waitpid(process, os.WNOHANG)
            if done:
                return os.waitstatus_to_exitcode(status)
            time.sleep(0.02)
        return None
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process, signal.SIGKILL)
        with suppress(ChildProcessError):
            os.waitpid(process, 0)


def _run(copy: Path, tests: list[str], seconds: float, told: Path, is_in_c: bool) -> None:
    """The tests, in this process, which ends then."""
    os.setpgid(0, 0)
    os.chdir(copy)
    output = os.open(copy.parent / "output", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(output, 1)
    os.dup2(output, 2)
    sys.path[:0] = [str(copy)]
    end = _spent() + seconds
    for part in _parts(tests):
        modules = list(dict.fromkeys(test.partition("::")[0] for test in part))
        options = [*OPTIONS, f"--basetemp={copy.parent / 'scratch'}", *modules]
        code = pytest.main(options, [Watch(part, end, told, is_in_c)])
        if code not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED):
            os._exit(code)
    os._exit(0)


def _parts(tests: list[str]) -> Iterator[list[str]]:
    """Tests in the same order, in parts of so few modules that they are soon collected."""
    part: list[str] = []
    for test in tests:
        if len({each.partition("::")[0] for each in (*part, test)}) > MODULES:
            yield part
            part = []
        part.append(test)
    yield part
