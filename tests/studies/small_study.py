"""A study of its own process, for the tests that end it: `python small_study.py FOLDER COUNT WORKERS`."""

from __future__ import annotations

import sys

from study_models import swing

import ncgen
import ncgen.studies.result

SWINGS = {"length": {"low": 0.8, "high": 1.2}, "start(rate(psi))": {"low": 1.0, "high": 2.0}}


def run(folder: str | None, count: int, workers: object = None, **options: object) -> ncgen.studies.result.StudyResult:
    given = {"keep": ["psi", "max(psi)", "steps"], "duration": 20.0, "rtol": 1e-9, "points": 401}
    return ncgen.study(swing(), SWINGS, design="sobol", count=count, seed=2, folder=folder, workers=workers, **given, **options)


if __name__ == "__main__":
    try:
        run(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]) or None, progress=lambda done, *_: print(done, flush=True))
    except (KeyboardInterrupt, ncgen.NcgenError) as error:
        print(type(error).__name__, error, flush=True)
        sys.exit(3)
