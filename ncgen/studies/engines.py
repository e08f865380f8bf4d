"""Who computes: this process with threads, or executors whose workers may be lost.

A worker is anything that takes `submit` as `concurrent.futures` has it: processes of this machine, a Dask cluster, loky. What is sent is
the study as bytes and the numbers of a chunk's variants, and columns come back; every worker compiles once, through its cache. The
numbers are sent, and not found again there, since to enter a sequence takes time, and what SciPy needs for it even more.
"""

from __future__ import annotations

import logging
import os
import pickle
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager, suppress
from typing import Any, Protocol

import numpy as np

from ncgen.errors import NcgenError
from ncgen.studies.variants import Bench, Part

POLL_SECONDS = 0.05
"""Seconds between two looks whether something has arrived, or somebody wants to stop."""

CHUNKS_PER_WORKER = 2
"""Chunks a worker has, so that it need not wait for the next one."""

LOSSES = 8
"""Workers lost in a row, with nothing done between, after which the study ends: it is the study that kills them."""

LOST_WORKER_ERRORS = ("KilledWorker", "FutureCancelledError", "CommClosedError")
"""Exceptions of Dask that say that a worker was lost."""

Progress = Callable[[float], None]

Chunk = tuple[int, np.ndarray]
"""The first of some variants, and their numbers (B, names)."""


class Engine(Protocol):
    """Computes chunks (first, count) that `next_chunk` gives, None when there are no more, and yields parts with seconds."""

    def parts(self, next_chunk: Callable[[], tuple[int, int] | None], progress: Progress) -> Generator[tuple[Part, float], None, None]: ...


class Here:
    """This process, with lanes and threads."""

    def __init__(self, bench: Bench, threads: int | None) -> None:
        self.bench, self.threads = bench, threads

    def parts(self, next_chunk: Callable[[], tuple[int, int] | None], progress: Progress) -> Generator[tuple[Part, float], None, None]:
        while chunk := next_chunk():
            clock = time.perf_counter()
            yield self.bench.part(*chunk, self.threads, lambda done, count=chunk[1]: progress(done * count)), time.perf_counter() - clock


class Workers:
    """An executor, made again where it breaks.

    make: a context with the executor; size: how many workers it has; threads: of lanes, in each of them
    """

    def __init__(self, bench: Bench, make: Callable[[], Any], size: int, threads: int = 1) -> None:
        self.study, self.make, self.size, self.threads = bench.study, make, size, threads
        self.digest, self.sent = self.study.digest, pickle.dumps((self.study, bench.sample))

    def parts(self, next_chunk: Callable[[], tuple[int, int] | None], progress: Progress) -> Generator[tuple[Part, float], None, None]:
        again: list[Chunk] = []
        lost = 0
        while True:
            broken = False
            with self.make() as executor:
                running: dict[Future[Any], Chunk] = {}
                while True:
                    while (
                        not broken
                        and len(running) < CHUNKS_PER_WORKER * self.size
                        and (chunk := again.pop() if again else self._chunk(next_chunk))
                    ):
                        try:
                            running[executor.submit(compute, self.digest, self.sent, *chunk, self.threads)] = chunk
                        except (BrokenExecutor, RuntimeError):
                            again.append(chunk)
                            broken = True
                    if not running:
                        break
                    done, _ = wait(running, POLL_SECONDS, FIRST_COMPLETED)
                    progress(0.0)
                    for future in done:
                        chunk = running.pop(future)
                        if (error := _failure(future)) is None:
                            lost = 0
                            block, seconds = future.result()
                            yield block.joined(self.study.design.names, chunk[1]), seconds
                        elif _is_lost(error):
                            again.append(chunk)
                            lost, broken = lost + 1, broken or isinstance(error, BrokenExecutor)
                        else:
                            raise error
                    if lost > LOSSES * CHUNKS_PER_WORKER * self.size:
                        first, rows = again[-1]
                        last = first + len(rows) - 1
                        raise NcgenError(f"workers die again and again, last with variants {first} to {last}; look at these")
            if not broken:
                return

    def _chunk(self, next_chunk: Callable[[], tuple[int, int] | None]) -> Chunk | None:
        chunk = next_chunk()
        return (chunk[0], self.study.design.rows(*chunk)) if chunk else None


def _failure(future: Future[Any]) -> BaseException | None:
    try:
        return future.exception()
    except CancelledError as error:
        return error


def _is_lost(error: BaseException) -> bool:
    """Whether a worker was lost, and not the study wrong."""
    return isinstance(error, (BrokenExecutor, CancelledError)) or type(error).__name__ in LOST_WORKER_ERRORS


# -- in a worker ---------------------------------------------------------------------------------------------------------------------------

_benches: dict[str, Bench] = {}
_first = threading.Lock()


def compute(digest: str, study: bytes, first: int, rows: np.ndarray, threads: int = 1) -> tuple[Part, float]:
    """Variants with these numbers (B, names) of a pickled study and its sample, and the seconds that they took."""
    with _first:
        if digest not in _benches:
            _benches.clear()
            _benches[digest] = Bench(*pickle.loads(study))
    clock = time.perf_counter()
    return _benches[digest].computed(first, rows, threads), time.perf_counter() - clock


def _prepare() -> None:
    """A process of a pool: Ctrl-C is its parent's, and it ends with that parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


# -- executors -----------------------------------------------------------------------------------------------------------------------------


@contextmanager
def processes(count: int) -> Iterator[Executor]:
    """Processes of this machine, which end at once where the study does: they have nothing to lose."""
    from multiprocessing import active_children, get_context

    others = active_children()
    executor = ProcessPoolExecutor(count, get_context("spawn"), _prepare)  # a fork would inherit threads that are no more
    try:
        yield executor
    except BaseException:
        for child in active_children():
            if child not in others:
                child.kill()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


@contextmanager
def borrowed(executor: Executor) -> Iterator[Executor]:
    """An executor of the caller's, which stays open."""
    yield executor


@contextmanager
def cluster(address: str, workers: int | None) -> Iterator[tuple[Executor, int]]:
    """A Dask cluster as an executor, and how many threads it has. address: of a scheduler, or "local" for a cluster of this machine."""
    try:
        from distributed import Client, LocalCluster  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise NcgenError("a cluster needs Dask, which is not installed; pip install 'ncgen[cluster]'") from error
    resources: list[Any] = []
    try:
        if address == "local":
            quiet = {"dashboard_address": None, "silence_logs": logging.ERROR}  # a chunk that is given up is nothing to warn of
            resources.append(LocalCluster(n_workers=workers, threads_per_worker=1, **quiet))
            resources.append(Client(resources[0]))
        else:
            try:
                resources.append(Client(address, timeout=10))
            except (OSError, ValueError) as error:
                raise NcgenError(f"cluster {address}: no scheduler answers there ({error}); give its address, or 'local'") from error
        client = resources[-1]
        yield client.get_executor(pure=False, retries=LOSSES), max(1, sum(client.nthreads().values()))
    finally:
        # Workers take a second or two to end, for which nobody waits but the end of Python.
        threading.Thread(target=_close, args=(resources,)).start()


def _close(resources: list[Any]) -> None:
    """Close a client, then its cluster."""
    for resource in reversed(resources):
        with suppress(Exception):
            resource.close(timeout=2)
