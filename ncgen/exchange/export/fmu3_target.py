"""A functional mock-up unit of FMI 3.0."""

from functools import partial

from ncgen.exchange.export.fmu import fmu_files, others

check, files = partial(others, version=3), partial(fmu_files, version=3)

HAS_EVENTS = True
