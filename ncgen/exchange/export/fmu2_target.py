"""A functional mock-up unit of FMI 2.0."""

from functools import partial

from ncgen.exchange.export.fmu import fmu_files, others

check, files = partial(others, version=2), partial(fmu_files, version=2)

HAS_EVENTS = True
