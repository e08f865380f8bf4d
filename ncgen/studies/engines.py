"""Who computes: this process with threads, or executors whose workers may be lost.

A worker is anything that takes `submit` as `concurrent.futures` has it: processes of this machine, a Dask cluster, loky. What is sent is
the study as bytes, two numbers a chunk come with it, and columns come back; every worker compiles once, through its cache.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, Protocol

from ncgen.errors import NcgenError
from ncgen.studies.definition import Study
from ncgen.studies.variants import Bench, Part

LOOK = 0.05
"""Seconds between two looks whether something has arrived, or somebody wants to stop."""

AHEAD = 2
"""Chunks a worker has, so that it need not wait for the next one."""

LOSSES = 8
"""Workers lost in a row, with nothing done between, after which the study ends: it is the study that kills them."""

LOST = ("KilledWorker", "FutureCancelledError", "CommClosedError")
"""Exceptions of Dask that say that a worker was lost."""

Progress = Callable[[float], None]


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
            yield self.bench.part(*chunk, self.threads, lambda share, count=chunk[1]: progress(share * count)), time.perf_counter() - clock


class Workers:
    """An executor, made again where it breaks.

    make: a context with the executor; size: how many workers it has; threads: of lanes, in each of them
    """

    def __init__(self, study: Study, make: Callable[[], Any], size: int, threads: int = 1) -> None:
        self.study, self.make, self.size, self.threads = pickle.dumps(study), make, size, threads
        self.digest = study.digest

    def parts(self, next_chunk: Callable[[], tuple[int, int] | None], progress: Progress) -> Generator[tuple[Part, float], None, None]:
        again: list[tuple[int, int]] = []
        lost = 0
        while True:
            broken = False
            with self.make() as executor:
                running: dict[Future[Any], tuple[int, int]] = {}
                while True:
                    while not broken and len(running) < AHEAD * self.size and (chunk := again.pop() if again else next_chunk()):
                        try:
                            running[executor.submit(compute, self.digest, self.study, *chunk, self.threads)] = chunk
                        except (BrokenExecutor, RuntimeError):
                            again.append(chunk)
                            broken = True
                    if not running:
                        break
                    done, _ = wait(running, LOOK, FIRST_COMPLETED)
                    progress(0.0)
                    for future in done:
                        chunk = running.pop(future)
                        if (error := _failure(future)) is None:
                            lost = 0
                            yield future.result()
                        elif _is_lost(error):
                            again.append(chunk)
                            lost, broken = lost + 1, broken or isinstance(error, BrokenExecutor)
                        else:
                            raise error
                    if lost > LOSSES * AHEAD * self.size:
                        first, count = again[-1]
                        raise NcgenError(f"workers die again and again, last with variants {first} to {first + count - 1}; look at these")
            if not broken:
                return


def _failure(future: Future[Any]) -> BaseException | None:
    try:
        return future.exception()
    except CancelledError as error:
        return error


def _is_lost(error: BaseException) -> bool:
    """Whether a worker was lost, and not the study wrong."""
    return isinstance(error, (BrokenExecutor, CancelledError)) or type(error).__name__ in LOST


# -- in a worker ---------------------------------------------------------------------------------------------------------------------------

_benches: dict[str, Bench] = {}
_first = threading.Lock()


def compute(digest: str, study: bytes, first: int, count: int, threads: int = 1) -> tuple[Part, float]:
    """Variants of a pickled study, and the seconds that they took."""
    with _first:
        if digest not in _benches:
            _benches.clear()
            _benches[digest] = Bench(pickle.loads(study))
    clock = time.perf_counter()
    return _benches[digest].part(first, count, threads), time.perf_counter() - clock


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
    with ExitStack() as stack:
        if address == "local":
            cluster = LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None)
            stack.callback(_close, cluster)
            client = Client(cluster)
        else:
            try:
                client = Client(address, timeout=10)
            except (OSError, ValueError) as error:
                raise NcgenError(f"cluster {address}: no scheduler answers there ({error}); give its address, or 'local'") from error
        stack.callback(_close, client)
        executor = client.get_executor(pure=False, retries=LOSSES)
        yield executor, max(1, sum(client.nthreads().values()))


def _close(thing: Any) -> None:
    with suppress(Exception):
        thing.close(timeout=2)
