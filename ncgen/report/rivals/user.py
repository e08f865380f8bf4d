"""A function of the user's own, by name: `module:function`, or `kernel=module:function`."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from ncgen.build.kernels import Kernels
from ncgen.errors import ModelError
from ncgen.report.rivals.base import Inputs, Rival, called, nonzeros

SHAPES = {"phi_q": "(rows, coordinates) or the nonzeros", "gamma": "(rows,)", "mass": "(coordinates, coordinates) or the nonzeros"}


def rivals(kernels: Kernels, inputs: Inputs, texts: list[str]) -> list[Rival]:
    """f(q) for Φ_q and M, f(q, q̇) for γ, as NumPy arrays, dense or the nonzeros in the kernel's order.

    Raises ModelError naming what cannot be imported, or an array of another shape.
    """
    return [_rival(kernels, inputs, text) for text in texts]


def _rival(kernels: Kernels, inputs: Inputs, text: str) -> Rival:
    head, _, tail = text.rpartition("=")
    kernel, (module, _, name) = head or "phi_q", tail.partition(":")
    if kernel not in SHAPES:
        raise ModelError(f"--with {text}: there is no kernel {kernel} to compare with; write one of {', '.join(SHAPES)} before the =")
    function = _imported(text, module, name)
    arguments = (inputs.q, inputs.qd) if kernel == "gamma" else (inputs.q,)
    size = kernels.programs.programs[kernel].size
    shape = {"phi_q": (kernels.m, kernels.n), "mass": (kernels.n, kernels.n)}.get(kernel)

    def values(_):
        value = function(*arguments)
        found = getattr(value, "shape", None)
        if found not in ((size,), shape):
            raise ModelError(f"--with {text}: it gives an array of shape {found}, {kernel} has {SHAPES[kernel]}")
        return value if found == (size,) else nonzeros(kernels, kernel, value)

    return called(text, {kernel: lambda: function(*arguments)}, values)


def _imported(text: str, module: str, name: str):
    folder = str(Path.cwd())
    if folder not in sys.path:
        sys.path.insert(0, folder)
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ModelError(f"--with {text}: {error}; write it as module:function, the module being importable from here") from None
