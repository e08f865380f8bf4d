"""MuJoCo's Python classes of compiled models without the rest of its package, which looks for a library of windows in a process of its own:
that takes longer than to compile most files.
"""

from __future__ import annotations

import ctypes
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any

PACKAGE = "mujoco"

MODULES = ("_specs", "_structs", "_callbacks", "_errors")
"""Extension modules of the package, with `MjModel`, what warnings are passed to, and `FatalError`."""

PLUGINS, LIBRARIES = "plugin", (".so", ".dylib", ".dll")
"""The package's folder of plugins, and what their names end with: models with plugins are read where these are loaded."""

_one_at_a_time = Lock()


def bindings() -> Any:
    """Return what has `MjModel`, `FatalError` and `set_mju_user_warning`: the package itself where it is imported already.

    Extension modules import each other by their names in the package, so an empty one stands for it meanwhile. Whoever imports the package
    later gets all of it, with the same modules.
    """
    with _one_at_a_time:
        spec = None if PACKAGE in sys.modules else find_spec(PACKAGE)
        if spec is None or not spec.submodule_search_locations:
            return import_module(PACKAGE)
        folders = list(spec.submodule_search_locations)
        empty = sys.modules[PACKAGE] = ModuleType(PACKAGE)
        empty.__path__ = folders
        try:
            for name in MODULES:
                vars(empty).update(vars(import_module(f"{PACKAGE}.{name}")))
            for folder in folders:
                for library in Path(folder, PLUGINS).glob("*"):  # as they lie there: MuJoCo numbers them, in its own process, too
                    if library.suffix in LIBRARIES:
                        ctypes.CDLL(str(library))
            return empty
        except ImportError:  # another release has other modules, and on Windows the package itself loads its library
            pass
        finally:
            del sys.modules[PACKAGE]
        return import_module(PACKAGE)
