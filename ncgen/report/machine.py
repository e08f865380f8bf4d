"""What a measurement was made with: without it a time means nothing."""

from __future__ import annotations

import os
import platform
import time
from importlib.metadata import PackageNotFoundError, version

from ncgen import __version__
from ncgen.toolchain.compilers import FLAGS, find_compiler, own_flags, processor

PACKAGES = ("numpy", "scipy", "sympy", "casadi", "jax", "symforce", "exudyn", "pin", "mujoco")


def machine() -> dict[str, str]:
    """{what: value}: processor, cores, system, compiler and flags, clock, Python and the packages that are there."""
    resolution = time.get_clock_info("perf_counter").resolution
    facts = {
        "processor": processor(),
        "cores": str(os.cpu_count()),
        "system": platform.platform(),
        "compiler": compiler.identity if (compiler := find_compiler()) else "none",
        "flags": " ".join((*FLAGS, *own_flags())),
        "clock": f"resolution {1e9 * resolution:.0f} ns",
        "ncgen": __version__,
        "python": platform.python_version(),
    }
    return facts | {name: text for name in PACKAGES if (text := _version(name))}


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
