"""A function of the user's own, by name: `module:function`, or `kernel=module:function`.

The module is imported and the function called, since that is what the user asks for; what is not made for it is refused before.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ncgen.comparisons.rivals.base import Inputs, Rival, called, nonzeros
from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels

SHAPES = {"phi_q": "(rows, coordinates) or the nonzeros", "gamma": "(rows,)", "mass": "(coordinates, coordinates) or the nonzeros"}


ARGUMENTS = {"phi_q": ("q",), "gamma": ("q", "qd"), "mass": ("q",)}


@dataclass(frozen=True)
class UserFunction:
    """What the user wrote after --with, the kernel it is compared with, and the function of that name."""

    text: str
    kernel: str
    function: Callable

    @classmethod
    def of(cls, text: str) -> UserFunction:
        """The function of a name. Raises ModelError where it cannot be imported or called as its kernel is."""
        head, _, tail = text.rpartition("=")
        kernel, (module, _, name) = head or "phi_q", tail.partition(":")
        if kernel not in SHAPES:
            raise ModelError(f"--with {text}: there is no kernel {kernel} to compare with; write one of {', '.join(SHAPES)} before the =")
        function = _imported(text, module, name)
        _check(text, function, ARGUMENTS[kernel])
        return cls(text, kernel, function)

    def __call__(self, *arguments: np.ndarray) -> Any:
        """What it gives. Raises ModelError with what it raises."""
        try:
            return self.function(*arguments)
        except Exception as error:  # the user's own code: whatever it raises is said in a line
            raise ModelError(f"--with {self.text}: it fails with {type(error).__name__}: {str(error)[:150]}") from error


def rivals(kernels: Kernels, inputs: Inputs, texts: list[str]) -> list[Rival]:
    """f(q) for Φ_q and M, f(q, q̇) for γ, as NumPy arrays, dense or the nonzeros in the kernel's order.

    Raises ModelError naming what cannot be imported or called, or an array of another shape.
    """
    return [_rival(kernels, inputs, UserFunction.of(text)) for text in texts]


def _rival(kernels: Kernels, inputs: Inputs, function: UserFunction) -> Rival:
    kernel, text = function.kernel, function.text
    arguments = (inputs.q, inputs.qd) if kernel == "gamma" else (inputs.q,)
    size = kernels.programs.programs[kernel].size
    shape = {"phi_q": (kernels.m, kernels.n), "mass": (kernels.n, kernels.n)}.get(kernel)

    def values(_: str) -> np.ndarray:
        value = function(*arguments)
        shape_given = getattr(value, "shape", None)
        if shape_given not in ((size,), shape):
            raise ModelError(f"--with {text}: it gives an array of shape {shape_given}, {kernel} has {SHAPES[kernel]}")
        return value if shape_given == (size,) else nonzeros(kernels, kernel, value)

    return called(text, {kernel: lambda: function(*arguments)}, values)


def _imported(text: str, module: str, name: str) -> Any:
    folder = str(Path.cwd())
    if folder not in sys.path:
        sys.path.insert(0, folder)
    try:
        return getattr(importlib.import_module(module), name)
    except Exception as error:  # the user's own code: whatever it raises is said in a line
        message = str(error) if isinstance(error, (ImportError, AttributeError, ValueError)) else f"{type(error).__name__}: {error}"
        raise ModelError(f"--with {text}: {message[:150]}; write it as module:function, the module being importable from here") from None


def _check(text: str, function: object, names: tuple[str, ...]) -> None:
    """Refuse what was not written for this: no function, one of Python's own, or one with other arguments."""
    call = f"f({', '.join(names)})"
    if not callable(function) or inspect.isclass(function) or inspect.isbuiltin(function):
        kind = "a built-in function" if inspect.isbuiltin(function) else f"a {type(function).__name__}"
        raise ModelError(f"--with {text}: it is {kind}; give a Python function of your own, {call}")
    try:
        inspect.signature(function).bind(*names)
    except (TypeError, ValueError) as error:
        raise ModelError(f"--with {text}: it cannot be called as {call} ({error}); give a function with these arguments") from None
