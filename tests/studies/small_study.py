"""A study of its own process, for the tests that end it: `python small_study.py FOLDER COUNT WORKERS`."""

from __future__ import annotations

import sys
from typing import Any

from study_models import swing

import ncgen
import ncgen.studies.result

SWINGS = {"length": {"low": 0.8, "high": 1.2}, "start(rate(psi))": {"low": 1.0, "high": 2.0}}


def run(folder: str | None, count: int, workers: Any = None, **options: Any) -> ncgen.studies.result.StudyResult:
    given = {"keep": ["psi", "max(psi)", "steps"], "duration": 20.0, "rtol": 1e-9, "points": 401}
    return ncgen.study(swing(), SWINGS, design="sobol", count=count, seed=2, output=folder, workers=workers, **given, **options)


def main(folder: str, count: int, workers: object, threads: int | None = None) -> int:
    """The study with what it says on standard output; what the process should end with."""
    try:
        run(folder, count, workers, threads=threads, progress=lambda done, *_: print(done, flush=True))
    except (KeyboardInterrupt, ncgen.NcgenError) as error:
        print(type(error).__name__, error, flush=True)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2]), sys.argv[3] if sys.argv[3] == "local" else int(sys.argv[3]) or None))
