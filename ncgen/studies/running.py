"""Studies carried out: chunks handed out, results written while they come, and gone on with where a study ended before."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack, closing, nullcontext
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, Unpack

from numpy.typing import ArrayLike

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.solver.argument_checks import count as whole
from ncgen.solver.argument_checks import echo
from ncgen.solver.groups import MotionArguments, takes
from ncgen.solver.runs.progress_reports import check_progress
from ncgen.studies import engines
from ncgen.studies.definition import Study
from ncgen.studies.design import Varied
from ncgen.studies.result import StudyResult
from ncgen.studies.study_folder import Folder, manifest
from ncgen.studies.variants import Bench, Part

AIM = 1.0
"""Seconds that a chunk should take: what is lost where a worker dies, and far above what it costs to hand one out."""

FIRST = 64
"""Variants of the first chunks, from which the cost is learnt."""

GROWTH = 8
"""Chunks grow by this factor at most from one to the next."""

MAX_CHUNK_BYTES = 64_000_000
"""Bytes of histories that a chunk may need while it is computed."""


@dataclass(kw_only=True)
class ChunkPace:
    """bytes_each: that a variant needs while it is computed; lanes: variants that should go together, at least."""

    bytes_each: int
    seconds_each: float | None = None
    size: int = FIRST
    done: int = 0
    _clock: float = field(default_factory=time.perf_counter)

    def chunk(self, left: int) -> int:
        """How many variants the next chunk has."""
        return max(1, min(left, self.size, MAX_CHUNK_BYTES // max(self.bytes_each, 1)))

    def learn(self, count: int, seconds: float) -> None:
        """A chunk of so many variants has taken a worker so many seconds."""
        each = seconds / count
        self.seconds_each = each if self.seconds_each is None else 0.5 * (self.seconds_each + each)
        self.size = int(max(1, min(GROWTH * self.size, AIM / max(self.seconds_each, 1e-9))))
        self.done += count

    def left(self, missing: float) -> float | None:
        """Seconds that so many variants will take, at the rate of all so far; None before any is done."""
        return None if not self.done else missing * (time.perf_counter() - self._clock) / self.done


ProgressOption = Callable[[int, int, "float | None"], None]
"""progress(done, all, seconds left or None)"""

Wanted: TypeAlias = "ProgressOption | bool | None"
"""In signatures: a function, True for a bar in a terminal or a notebook, None or False for nobody."""


class StudyArguments(MotionArguments, total=False):
    """The design of a study, who computes it, and the run that its variants have in common.

    Parameters
    ----------
    design : str
        "grid" (all combinations), "list" (the first numbers together, then the second …), "random", "latin", "sobol", "halton", or
        "saltelli", from which `sobol` of the result computes Sobol' indices.
    count : int, optional
        Number of variants, or of points of "saltelli".
    seed : int
        Seed of all designs but "grid" and "list".
    workers : int, str or Executor, optional
        Default: this process with `threads`. A number of processes; "local" for a Dask cluster of this machine, or the address of a
        scheduler; or an executor as of `concurrent.futures`.
    threads : int, optional
        Number of threads. Default: one on every processor that this process may use.
    duration : float, optional
        Length of the runs in s. Default: the model's own, or 1 s.
    points : int or array_like, shape (points,), optional
        Number of times at which extremes and energy are looked at, or the times in s.
    stop : {coordinate: value}, optional
        As of `simulate`.
    """

    design: str
    count: int | None
    seed: int
    workers: int | str | Executor | None
    threads: int | None
    duration: float | None
    points: int | ArrayLike
    stop: Mapping[str, Any] | None


OF_THE_STUDY = {"design": "grid", "count": None, "seed": 0, "workers": None, "threads": None}
"""Arguments of a study that are not those of its runs, and their defaults."""


@takes(StudyArguments, former={"folder": "output"}, **OF_THE_STUDY, duration=None, points=None, stop=None)
def study(
    model: Model | Kernels,
    vary: Varied,
    *,
    keep: str | Sequence[str],
    times: Iterable[float] | None = None,
    steps: int | None = None,
    output: str | os.PathLike[str] | None = None,
    progress: Wanted = None,
    **arguments: Unpack[StudyArguments],
) -> StudyResult:
    """Simulate many variants of a mechanism, and keep some numbers of each.

    Parameters
    ----------
    model : Model or Kernels
        Mechanism; its own simulation gives the defaults of the runs.
    vary : {name: values}
        Names are parameters, `start(psi)` of a coordinate, or `start(rate(psi))` of an independent velocity. Values are a list of numbers,
        {"low": a, "high": b} (with "scale": "log", or in a grid "count": n), or {"mean": m, "deviation": s}.
    keep : str or sequence of str
        Columns: a coordinate, its `rate(…)` or an output at the end; `max(…)` and `min(…)` of them over the run; `history(…)` at `times`;
        `energy_drift`, `steps`, `time`; `gradient(max(psi), mass)`, the derivative of a value at the end or an extreme by a parameter or a
        `start(…)`, or `gradient(max(psi))` by all that varies.
    times : iterable of float, optional
        Times in s of histories.
    steps : int, optional
        Number of equal steps of the motions that gradients go through, as of `gradient`.
    output : path, optional
        Folder to which results are written while they are computed; an existing study is resumed.
    progress : callable or bool, optional
        Called with the number of variants that are done, the number of all, and the seconds left (None before that is known); True for a
        bar. What it raises ends the study.
    **arguments : StudyArguments
        Where formalism and integrator are left open, variants run as SIMD batches by dopri5 if the mechanism allows it.

    Returns
    -------
    StudyResult
        The columns. A variant that cannot start or continue is a row with `ok` False and a message in `failures`. The same study gives the
        same bits with any workers, chunks and restarts on machines of one kind.

    Raises
    ------
    ModelError
        For invalid arguments.
    NcgenError
        Where the folder cannot be written. Ctrl-C keeps what is in the folder.
    """
    design = {**OF_THE_STUDY, **{name: value for name, value in arguments.items() if name in OF_THE_STUDY}}
    runs = {name: value for name, value in arguments.items() if name not in OF_THE_STUDY}
    workers, threads = design.pop("workers"), design.pop("threads")
    return carry_out(
        Study.of(model, vary, keep=keep, times=times, steps=steps, simulation=runs, **design), output, workers, threads, progress
    )


def carry_out(
    study: Study,
    output: str | os.PathLike[str] | None = None,
    workers: int | str | Executor | None = None,
    threads: int | None = None,
    progress: Wanted = None,
) -> StudyResult:
    """The result of a study; arguments as of `ncgen.study`."""
    threads = None if threads is None else whole(threads, "threads")
    check_progress(progress)
    bench = Bench(study)
    about = Folder.of(Path(output), study, bench.made_with) if output is not None else None
    with ExitStack() as stack:
        stack.enter_context(about.held() if about else nullcontext())
        missing = about.missing() if about else [(0, study.size)]
        parts: list[Part] = []
        keep = about.write if about else parts.append
        engine = _engine(bench, workers, threads, stack)
        advance = _progress_of(study, progress, stack)
        for block in stack.enter_context(closing(_Work(study, missing, advance).parts(engine))):
            keep(block)
    return StudyResult(about.manifest if about else manifest(study, bench.made_with), about, tuple(parts))


def _progress_of(study: Study, progress: Wanted, stack: ExitStack) -> ProgressOption | None:
    """The receiver of progress reports."""
    if progress is True:
        from ncgen.report.bar import timed

        return stack.enter_context(timed(f"{study.model.name}: {study.size} variants", study.size))
    return progress or None


def _engine(bench: Bench, workers: object, threads: int | None, stack: ExitStack) -> engines.Engine:
    """Who computes. Raises ModelError for what is not one."""
    if workers is None:
        return engines.Here(bench, threads)
    if isinstance(workers, str):
        executor, size = stack.enter_context(engines.cluster(workers, threads))
        return engines.Workers(bench, partial(engines.borrowed, executor), size)
    if isinstance(workers, int) and not isinstance(workers, bool):
        size = whole(workers, "workers")
        return engines.Workers(bench, partial(engines.processes, size), size, threads or 1)
    if isinstance(workers, Executor):
        return engines.Workers(bench, partial(engines.borrowed, workers), os.cpu_count() or 1, threads or 1)
    raise ModelError(f"workers: {echo(workers)} given; give a number of processes, 'local', the address of a Dask scheduler or an executor")


class _Work:
    """What is still to be done, in chunks, and how far it is."""

    def __init__(self, study: Study, missing: list[tuple[int, int]], progress: ProgressOption | None) -> None:
        self.study, self.missing, self.progress = study, list(reversed(missing)), progress
        self.left = sum(end - first for first, end in missing)
        n = sum(not c.fixed for c in study.model.components)
        self.pace = ChunkPace(bytes_each=16 * n * len(study.grid))

    def next_chunk(self) -> tuple[int, int] | None:
        """(first, count) of the next variants."""
        if not self.missing:
            return None
        first, end = self.missing.pop()
        count = self.pace.chunk(end - first)
        if first + count < end:
            self.missing.append((first + count, end))
        return first, count

    def parts(self, engine: engines.Engine) -> Generator[Part, None, None]:
        """All parts, in the order in which they are done."""
        self.report_progress(0.0)
        with closing(engine.parts(self.next_chunk, self.report_progress)) as done:
            for block, seconds in done:
                self.left -= len(block)
                self.pace.learn(len(block), seconds)
                yield block
                self.report_progress(0.0)

    def report_progress(self, more: float) -> None:
        """more: variants that are done in addition to those that have arrived."""
        if self.progress:
            left = self.left - more
            self.progress(int(self.study.size - left), self.study.size, self.pace.left(left))
