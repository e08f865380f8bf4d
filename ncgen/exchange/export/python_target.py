"""A Python package, compiled while it is installed."""

from functools import partial

from ncgen.exchange.export.python_package import python_files

files = partial(python_files, compiled=True)

HAS_EVENTS = True
