"""A cache for each test, compilers that can be told what to do, and work in other processes."""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import shutil
from pathlib import Path

import pytest

import ncgen
from ncgen import Model
from ncgen.toolchain.compilers import Compiler, find_compiler


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    """An empty cache folder of the test's own, not yet made."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("NCGEN_CACHE_DIR", str(folder))
    return folder


@pytest.fixture
def scripted(tmp_path, monkeypatch):
    """scripted(body): $CC becomes a shell script that runs `body`, where "$@" is the command line and $CC the real compiler."""
    real = shutil.which("cc") or shutil.which("gcc")

    def make(body: str) -> Compiler:
        script = tmp_path / "compiler"
        script.write_text(f"#!/bin/sh\nCC={real}\n{body}\n")
        script.chmod(0o755)
        monkeypatch.setenv("CC", str(script))
        return find_compiler()

    return make


@pytest.fixture(scope="session")
def pendulum_sources():
    """Sources of a pendulum: the least that has every kernel but nu."""
    model = Model("pendulum")
    pivot, bob = model.point("pivot", (0, 0), fixed=True), model.point("bob", (1, 0))
    model.body("bob", points=[bob], mass=1.0)
    model.distance(pivot, bob)
    model.gravity((0, -9.81, 0))
    return ncgen.generate(model)


class Child:
    """A function running in a forked process; result() is what it returned, or minus the signal that ended it."""

    def __init__(self, function, *arguments):
        context = multiprocessing.get_context("fork")
        self._receiver, self._sender = context.Pipe(duplex=False)
        self.process = context.Process(target=self._run, args=(function, arguments))
        self.process.start()
        self._sender.close()

    def _run(self, function, arguments):
        faulthandler.disable()
        try:
            answer = function(*arguments)
        except BaseException as error:
            answer = error
        self._sender.send(answer)
        os._exit(0)

    def result(self):
        try:
            answer = self._receiver.recv()
        except EOFError:
            self.process.join()
            return self.process.exitcode
        self.process.join()
        return answer


@pytest.fixture(scope="session")
def child():
    return Child
