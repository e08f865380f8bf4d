"""Studies carried out: chunks handed out, results written while they come, and gone on with where a study ended before."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack, closing, nullcontext
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.solver.given import count as whole
from ncgen.solver.given import echo
from ncgen.solver.runs.telling import check_told
from ncgen.studies import engines
from ncgen.studies.definition import Study
from ncgen.studies.design import Varied
from ncgen.studies.folder import Folder, manifest
from ncgen.studies.pace import Pace
from ncgen.studies.result import StudyResult
from ncgen.studies.variants import Bench, Part

Told = Callable[[int, int, "float | None"], None]
"""progress(done, all, seconds left or None)"""

Wanted: TypeAlias = "Told | bool | None"
"""In signatures: a function, True for a bar in a terminal or a notebook, None or False for nobody."""


def study(
    model: Model | Kernels,
    vary: Varied,
    *,
    keep: str | Sequence[str],
    design: str = "grid",
    count: int | None = None,
    seed: int = 0,
    times: Iterable[float] | None = None,
    steps: int | None = None,
    folder: str | os.PathLike[str] | None = None,
    workers: int | str | Executor | None = None,
    threads: int | None = None,
    progress: Wanted = None,
    **simulation: Any,
) -> StudyResult:
    """Simulate many variants of a mechanism, and keep some numbers of each.

    vary: {name: what}, where a name is a parameter, `start(psi)` of a coordinate or `start(rate(psi))` of an independent velocity, and
        what is a list of numbers, {"low": a, "high": b} (with "scale": "log", or in a grid "count": n), or {"mean": m, "deviation": s}
    design: "grid" (all combinations), "list" (the first numbers together, then the second …), "random", "latin", "sobol", "halton", or
        "saltelli", from which `result.sobol` takes Sobol' indices; count: variants, or points of saltelli; seed: of all but grid and list
    keep: words for columns: a coordinate, its `rate(…)` or an output at the end; `max(…)` and `min(…)` of them over the run; `history(…)`
        at `times` (s); `energy_drift`, `steps`, `time`; `gradient(max(psi), mass)`, how a value at the end or an extreme changes with a
        parameter or a `start(…)`, or `gradient(max(psi))`, with all that varies: through `steps` equal steps, as by `ncgen.gradient`
    folder: where results are written while they are found; a study that is there already goes on where it ended
    workers: None for this process with `threads` (None: all processors); a number of processes; "local" for a Dask cluster of this
        machine or the address of a scheduler; or an executor as of concurrent.futures
    progress: called with the variants that are done, all, and the seconds left (None before that is known); True for a bar; what it
        raises ends the study
    simulation: everything else that `ncgen.simulate` takes, such as duration, rtol, stop; what the model's own `simulation` says is the
        default. Where formalism and integrator are left open, variants run in lanes by dopri5 if the mechanism allows it

    A variant that cannot start or go on is a row with `ok` False and a sentence in `result.failures`. The same study gives the same bits
    with any workers, chunks and restarts on machines of one kind.
    Raises ModelError for what cannot be asked, NcgenError where the folder cannot be written; Ctrl-C keeps what is in the folder.
    """
    asked = Study.of(model, vary, design=design, count=count, seed=seed, keep=keep, times=times, steps=steps, simulation=simulation)
    return carry_out(asked, folder, workers, threads, progress)


def carry_out(
    study: Study,
    folder: str | os.PathLike[str] | None = None,
    workers: int | str | Executor | None = None,
    threads: int | None = None,
    progress: Wanted = None,
) -> StudyResult:
    """The result of a study; arguments as of `ncgen.study`."""
    threads = None if threads is None else whole(threads, "threads")
    check_told(progress)
    bench = Bench(study)
    about = Folder.of(Path(folder), study, bench.made_with) if folder is not None else None
    with ExitStack() as stack:
        stack.enter_context(about.held() if about else nullcontext())
        missing = about.missing() if about else [(0, study.size)]
        parts: list[Part] = []
        keep = about.write if about else parts.append
        engine = _engine(bench, workers, threads, stack)
        told = _told(study, progress, stack)
        for part in stack.enter_context(closing(_Work(study, missing, told).parts(engine))):
            keep(part)
    return StudyResult(about.manifest if about else manifest(study, bench.made_with), about, tuple(parts))


def _told(study: Study, progress: Wanted, stack: ExitStack) -> Told | None:
    """Who is told how far it is."""
    if progress is True:
        from ncgen.report.bar import timed

        return stack.enter_context(timed(f"{study.model.name}: {study.size} variants", study.size))
    return progress or None


def _engine(bench: Bench, workers: object, threads: int | None, stack: ExitStack) -> engines.Engine:
    """Who computes. Raises ModelError for what is none."""
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

    def __init__(self, study: Study, missing: list[tuple[int, int]], progress: Told | None) -> None:
        self.study, self.missing, self.progress = study, list(reversed(missing)), progress
        self.left = sum(end - first for first, end in missing)
        n = sum(not c.fixed for c in study.model.components)
        self.pace = Pace(16 * n * len(study.grid))

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
        self.tell(0.0)
        with closing(engine.parts(self.next_chunk, self.tell)) as found:
            for part, seconds in found:
                self.left -= len(part)
                self.pace.learn(len(part), seconds)
                yield part
                self.tell(0.0)

    def tell(self, more: float) -> None:
        """more: variants that are done beside those that have arrived."""
        if self.progress:
            left = self.left - more
            self.progress(int(self.study.size - left), self.study.size, self.pace.left(left))
