"""A Python package, in NumPy alone."""

from functools import partial

from ncgen.exchange.export.python_package import python_files

files = partial(python_files, compiled=False)
