"""What is made once is one thing, also for threads that ask at the same time."""

from __future__ import annotations

import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

from ncgen.toolchain.once import once

THREADS = 8

ASK = """
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from ncgen.toolchain.abi import abi, runtime_abi

start = Barrier(8)


def ask(number):
    start.wait()
    return id(runtime_abi("double")), id(abi("double"))


with ThreadPoolExecutor(8) as threads:
    print(len(set(threads.map(ask, range(8)))))
"""


def test_one_call_serves_all():
    calls, start = [], Barrier(THREADS)

    @once
    def made(name: str) -> object:
        calls.append(name)
        time.sleep(0.01)
        return object()

    def ask(_: int) -> object:
        start.wait()
        return made("a")

    with ThreadPoolExecutor(THREADS) as threads:
        assert len(set(threads.map(ask, range(THREADS)))) == 1
    assert calls == ["a"] and made("b") is not made("a")


def test_types_are_the_same_in_all_threads():
    """Structs of two interfaces do not go together, although they look the same."""
    done = subprocess.run([sys.executable, "-c", ASK], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "1"
