"""Functions of Python in tables of C: what they have in common, and kernels of NumPy as an `ncgen_model`."""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.library import STATUS, CompiledKernels
from ncgen.program.ir.blocks import Pattern, Program
from ncgen.toolchain.abi import InC, Interface, abi_version, runtime_abi

INTERRUPTED = STATUS.index("interrupted")

KINDS = {
    ("t", "q", "p"): "ncgen_position_kernel *",
    ("t", "q", "qd", "p"): "ncgen_velocity_kernel *",
    ("t", "q", "qd", "qdd", "p"): "ncgen_motion_kernel *",
    ("t", "q", "qd", "qdd", "lam", "p"): "ncgen_balance_kernel *",
}
"""{inputs: type of a kernel in C}."""


class _Thread(threading.local):
    """State of one thread.

    raised: what a function raised, or None; places: of `ExternalForces`, pointers of C and arrays that are this memory
    """

    raised: BaseException | None = None
    buffers: tuple[Any, ...] | None = None


class InPython:
    """Functions of Python that C calls, in doubles.

    What one of them raises ends the run on its thread: `raised` has it then, and none is called again before `begin`.
    """

    def __init__(self, kernels: Kernels) -> None:
        self.ffi: Interface = runtime_abi()
        self.thread = _Thread()
        n = kernels.n
        self.counts = {"q": n, "qd": n, "qdd": n, "lam": kernels.m, "p": len(kernels.p0)}
        self.alive: list[Any] = []

    def begin(self) -> None:
        """Forget what was raised on this thread."""
        self.thread.raised = None

    @property
    def raised(self) -> BaseException | None:
        """What a function raised on this thread since `begin`, or None."""
        return self.thread.raised

    def array(self, address: InC, count: int) -> np.ndarray:
        """The numbers (count,) in C's memory."""
        return np.frombuffer(self.ffi.buffer(address, 8 * count))

    def put(self, function: Callable[..., int], kind: str) -> InC:
        """A function for a table of C, which lives as long as this object; kind: its type there."""
        self.alive.append(self.ffi.callback(kind, function, error=INTERRUPTED, onerror=self._keep))
        return self.alive[-1]

    def kernel(self, inputs: tuple[str, ...], size: int, function: Callable[..., np.ndarray]) -> InC:
        """A kernel of C: function(t, *arrays) returns `size` numbers; inputs: what it takes, by name."""
        counts, thread, array = [self.counts[name] for name in inputs[1:]], self.thread, self.array

        def kernel(t: float, *addresses: InC) -> int:
            if thread.raised is not None:
                return INTERRUPTED
            array(addresses[-1], size)[:] = function(t, *(array(address, count) for address, count in zip(addresses, counts, strict=False)))
            return 0

        return self.put(kernel, KINDS[inputs])

    def pattern(self, pattern: Pattern) -> dict[str, Any]:
        """A sparsity for a table of C."""
        columns = self.ffi.new("int[]", pattern.indices), self.ffi.new("int[]", pattern.indptr)
        self.alive += columns
        return {"rows": pattern.shape[0], "columns": pattern.shape[1], "indices": columns[0], "indptr": columns[1]}

    def _keep(self, kind: type[BaseException], raised: BaseException, traceback: TracebackType) -> None:
        self.thread.raised = raised


class KernelsInPython(InPython):
    """Kernels of NumPy as an ncgen_model, and their derivatives as ncgen_tangents."""

    def __init__(self, kernels: Kernels) -> None:
        super().__init__(kernels)
        self._kernels, programs = kernels, kernels.programs.programs
        self.model: InC = self.ffi.new("ncgen_model *", {
            "abi_version": abi_version(), "struct_size": self.ffi.sizeof("ncgen_model"), "real_size": self.ffi.sizeof("ncgen_real"),
            "n_coordinates": kernels.n, "n_rows": kernels.m, "n_parameters": len(kernels.p0), "n_inputs": len(kernels.inputs),
            "mass_is_constant": "mass" in programs and programs["mass"].is_constant,
        })  # fmt: skip
        for name, pattern in (("phi_q_pattern", kernels.programs.phi_q), ("mass_pattern", kernels.programs.mass)):
            if pattern.shape[0]:
                setattr(self.model, name, self.pattern(pattern))
        for name, program in programs.items():
            setattr(self.model, name, self.kernel(program.inputs, program.size, self._of(name, program)))

    def _of(self, name: str, program: Program) -> Callable[..., np.ndarray]:
        call, takes_qd, size = self._kernels._call, "qd" in program.inputs, program.size
        if takes_qd:
            return lambda t, q, qd, p: call(name, t, q, qd, p, size)
        return lambda t, q, p: call(name, t, q, None, p, size)

    def tangents(self) -> InC:
        """An ncgen_tangents."""
        of_state = self._kernels.tangents
        made = self.ffi.new("ncgen_tangents *", {"abi_version": abi_version(), "struct_size": self.ffi.sizeof("ncgen_tangents")})
        for name, program in of_state.programs.programs.items():

            def values(*arrays: Any, name: str = name, program: Program = program) -> np.ndarray:
                return of_state.values(name, dict(zip(program.inputs, arrays, strict=True)))

            setattr(made, f"{name}_pattern", self.pattern(of_state.programs.patterns[name]))
            setattr(made, name, self.kernel(program.inputs, program.size, values))
        return made


def in_python(kernels: Kernels) -> KernelsInPython | None:
    """The table of kernels that are functions of Python, made once; None for those that are compiled."""
    return None if isinstance(kernels, CompiledKernels) else _table(kernels)


def model_of(kernels: Kernels) -> InC:
    """The ncgen_model of kernels, in doubles."""
    return kernels.descriptor if isinstance(kernels, CompiledKernels) else _table(kernels).model


def tangents_of(kernels: Kernels) -> InC:
    """Their ncgen_tangents."""
    if isinstance(kernels, CompiledKernels):
        return kernels.tangents.descriptor
    return kernels.remember("tangents in C", (), _table(kernels).tangents)


def _table(kernels: Kernels) -> KernelsInPython:
    return kernels.remember("table in C", (), lambda: KernelsInPython(kernels))
