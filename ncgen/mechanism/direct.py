"""A kernel on arrays of its own, for loops in Python: a call costs little more than the kernel."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from ncgen.emit.runtime_files import runtime_files
from ncgen.errors import NcgenError, shown
from ncgen.mechanism.arguments import numbers
from ncgen.mechanism.library import STATUS, CompiledKernels
from ncgen.toolchain.abi import InC, Interface, abi, marked
from ncgen.toolchain.loader import load
from ncgen.toolchain.once import once


@once
def _caller() -> tuple[Interface, InC]:
    text = Path(__file__).with_name("ncgen_call.c").read_text(encoding="utf-8")
    return load({"ncgen_call.c": text} | runtime_files("ncgen.h"), marked(text), abi())


class Direct:
    """One kernel of a compiled mechanism with its arguments and its result in place.

    q, qd: free coordinates (m, rad) and velocities, shape (n,); p: parameters, shape (n_p,); t: time (s)
    out: the result, shape (m,), (n,) or (3,); of a matrix the nonzeros in the order of its pattern
    Fill the arrays (`direct.q[:] = ...`), call the object, read `out`; the next call overwrites it. Nothing is checked or
    copied. `direct.q = ...` checks what is given and copies it into its place; the arrays themselves stay, and outlive the
    object. An object serves one thread; make one for each.
    Raises NcgenError for a kernel that the mechanism does not have or that calls Python, and where a kernel fails.
    """

    __slots__ = ("q", "qd", "p", "out", "_name", "_frame", "_run", "_owner")

    q: np.ndarray
    qd: np.ndarray
    p: np.ndarray
    out: np.ndarray
    _name: str
    _frame: InC
    _run: Callable[[], int]
    _owner: CompiledKernels

    def __init__(self, kernels: CompiledKernels, name: str) -> None:
        program = kernels.programs.programs.get(name)
        called = f"{kernels.name}.{name}"
        if program is None:
            raise NcgenError(f"{called}: there is no such kernel here; there are {', '.join(kernels.programs.programs)}")
        if kernels.model.callbacks and name in ("force", "energy"):
            raise NcgenError(f"{called}: the model calls a Python function; call kernels.{name} instead")
        ffi, library = _caller()
        frame = ffi.new("ncgen_frame *")
        setattr(frame, "velocity" if "qd" in program.inputs else "position", kernels.function(name))
        for array, size in {"q": kernels.n, "qd": kernels.n, "p": len(kernels.p0), "out": program.size}.items():
            numbers_in_c = ffi.new("double[]", max(1, size))
            setattr(frame, array, numbers_in_c)
            # A view of memory that C owns: unlike an array that owns its numbers it cannot be resized.
            self._set(array, np.frombuffer(ffi.buffer(numbers_in_c))[:size])
        self.q[:], self.p[:] = kernels.q0, kernels.p0
        self._set("_name", called)
        self._set("_frame", frame)
        self._set("_run", partial(library.ncgen_call, frame))
        self._set("_owner", kernels)  # the library lives as long

    _set = object.__setattr__

    def __setattr__(self, name: str, value: Any) -> None:
        """Arguments are copied into their places."""
        if name == "t":
            self._set(name, value)
        elif value is getattr(self, name, None):
            pass  # what `direct.q += 1` does at its end
        elif name in ("q", "qd", "p"):
            array, values = getattr(self, name), numbers(value, f"{self._name}: {name}")
            if values.shape != array.shape:
                raise NcgenError(f"{self._name}: {name} has shape {values.shape}; {array.shape} is needed")
            array[:] = values
        else:
            raise NcgenError(f"{self._name}: {name} cannot be replaced; q, qd, p and t are the arguments, out is where C writes")

    def __delattr__(self, name: str) -> None:
        raise NcgenError(f"{self._name}: {name} cannot be deleted; C uses it")

    def __reduce__(self) -> NoReturn:
        raise NcgenError(f"{self._name}: a kernel on arrays of its own is not copied; call kernels.direct again")

    @property
    def t(self) -> float:
        """Time (s)."""
        return self._frame.t

    @t.setter
    def t(self, value: float) -> None:
        try:
            self._frame.t = value
        except (TypeError, OverflowError):
            raise NcgenError(f"{self._name}: t is {shown(value)}; a number is needed") from None

    def __call__(self) -> None:
        """Evaluate the kernel into `out`."""
        if status := self._run():
            raise NcgenError(f"{self._name}: the kernel returned “{STATUS[status]}”")
