"""Programs and C source of a model kept in the cache folder, so that a second start neither imports sympy nor derives anything.

The key is the whole model and the state of the generator's own files. A model that cannot be pickled (it holds a Python
function) is generated every time. What is read back was written by this user, like the compiled libraries beside it.
"""

from __future__ import annotations

import hashlib
import io
import pickle
from functools import cache

from ncgen import __version__
from ncgen.build.cache import KEPT, cache_folder
from ncgen.emit.sources import Sources, write_bytes
from ncgen.model import Model
from ncgen.program.programs import Programs
from ncgen.resources import package_files
from ncgen.symbolic.numbering import Deferred

LARGEST = 4_000_000
"""Bytes up to which an entry is kept: larger models are seldom started again and again."""

UNPICKLABLE = (pickle.PickleError, AttributeError, TypeError)
"""What pickle says of functions without a name, one after the other of Python's versions."""


def recall(model: Model, emission: str) -> Sources | None:
    """The sources of a model that was compiled before, or None."""
    path = _path(model, emission)
    if path is None or not path.is_file():
        return None
    try:
        programs, phi_q, mass, omitted, files = pickle.loads(path.read_bytes())
    except (OSError, EOFError, ValueError, *UNPICKLABLE):
        return None  # damaged: it is written again
    sources = Sources(Programs(Deferred(model), programs, phi_q, mass, emission, omitted))
    sources.__dict__["c"] = files
    return sources


def remember(model: Model, emission: str, sources: Sources) -> None:
    """Keep the sources of a model, if it can be recognised again."""
    path = _path(model, emission)
    if path is None:
        return
    found = sources.programs
    data = pickle.dumps((found.programs, found.phi_q, found.mass, found.omitted, sources.c), protocol=5)
    if len(data) <= LARGEST:
        write_bytes(path, data)


def _path(model: Model, emission: str):
    """Where the sources of a model are kept; None for a model that cannot be told from others."""
    stream = io.BytesIO()
    try:
        pickle.Pickler(stream, protocol=5).dump(model)
    except UNPICKLABLE:
        return None
    digest = hashlib.sha256(b"\0".join((_generator(), emission.encode(), stream.getvalue())))
    return cache_folder() / KEPT[0] / f"{digest.hexdigest()[:40]}.pickle"


@cache
def _generator() -> bytes:
    """The version, and size and time of every file of the generator and of its templates."""
    lines = [__version__]
    for path in package_files("model", "symbolic", "program", "emit", "templates"):
        facts = path.stat()
        lines.append(f"{path.name} {facts.st_size} {facts.st_mtime_ns}")
    return "\n".join(lines).encode()
