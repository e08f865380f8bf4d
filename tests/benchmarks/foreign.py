"""C and Python that ncgen did not write, as functions with the face of kernels; and where a model begins."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from ncgen.exchange.examples import example_module, example_names
from ncgen.mechanism.kernels import Kernels
from ncgen.report.repeat import KernelCall
from ncgen.resources import folder
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.partition import Partitions, partitions_for
from ncgen.toolchain.abi import abi
from ncgen.toolchain.cache import BuiltLibrary, compiled
from ncgen.toolchain.loader import opened


def foreign(files: dict[str, str], sizes: dict[str, int], symbol: str) -> tuple[dict[str, KernelCall], BuiltLibrary]:
    """{kernel: call} of C sources that ncgen did not write, whose functions have the arguments of kernels; and the library.

    sizes: how many numbers each kernel writes; symbol: its name in C, with {} for the kernel's
    """
    built = compiled(files)
    kinds = {name: "velocity" if name == "gamma" else "position" for name in sizes}
    ffi, library = opened(built.library, "".join(f"ncgen_{kinds[name]}_kernel {symbol.format(name)};" for name in sizes), abi())
    return {name: KernelCall(ffi.addressof(library, symbol.format(name)), size, library) for name, size in sizes.items()}, built


def handwritten(kernels: Kernels) -> ModuleType | None:
    """The example's module of hand-written functions, or None."""
    if kernels.name not in example_names() or not (folder("examples") / kernels.name / "handwritten.py").is_file():
        return None
    return example_module(kernels.name, "handwritten.py")


def own_start(kernels: Kernels) -> tuple[np.ndarray, Partitions]:
    """The closed position (n,) that a model begins at, and independent coordinates there: those that it names, or good ones."""
    q = assemble(kernels, kernels.q0)
    return q, partitions_for(kernels, q, 0.0, kernels.p0)
