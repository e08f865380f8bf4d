"""The generated NumPy module as kernels: needs no compiler, takes batches and complex numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ncgen.emit.sources import Sources
from ncgen.mechanism.kernel_batch import NumPyBatch
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.tangents import NumPyTangents
from ncgen.program.programs import Programs
from ncgen.toolchain.loader import executed


class NumPyKernels(Kernels):
    """Kernels of the generated NumPy source. Leading axes of q, qd and p are batches."""

    backend = "numpy"
    batches = True

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources.programs)
        namespace = executed(sources.numpy)
        self._functions: dict[str, Callable[..., np.ndarray]] = {kernel: namespace[kernel] for kernel in sources.programs.programs}

    @classmethod
    def _of(cls, programs: Programs) -> NumPyKernels:
        return cls(Sources(programs))

    _tangents = NumPyTangents
    _batch = NumPyBatch

    def _call(self, kernel: str, t: ArrayLike, q: np.ndarray, qd: np.ndarray | None, p: np.ndarray, size: int) -> np.ndarray:
        arrays = (q, p) if qd is None else (q, qd, p)
        with np.errstate(all="ignore"):  # as in C, what is no number says so by itself
            return self._functions[kernel](t, *arrays)
