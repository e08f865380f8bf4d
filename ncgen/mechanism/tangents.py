"""The tangent kernels of a mechanism, ready to be called: made when they are first needed.

Explicit integrators never need them, so they are generated and compiled apart from the other kernels. `Tangents` are
those by position and velocity, or those by the parameters (ncgen.program.differentiation.tangent_programs).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ncgen.emit.c import files as in_c
from ncgen.emit.naming import prefix_of
from ncgen.emit.numpy import files as in_numpy
from ncgen.emit.runtime_files import HEADERS, runtime_files
from ncgen.errors import NcgenError
from ncgen.mechanism import recall
from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.numbered import kept_tangents
from ncgen.mechanism.recall import Files
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.programs import Programs, TangentPrograms
from ncgen.toolchain.abi import InC, Interface, abi
from ncgen.toolchain.compilers import flags_for
from ncgen.toolchain.loader import executed, load

if TYPE_CHECKING:
    from ncgen.symbolic.numbering import Terms


FEW_CALLS = 16
"""Calls of each kernel that come without a compiler, which costs as much as hundreds of them: `linearise` needs one or two."""


class Tangents(ABC):
    """Nonzeros of the derivatives of the equations of motion."""

    def __init__(self, programs: TangentPrograms, equations: Terms) -> None:
        self.programs = programs
        self.equations = equations

    def __repr__(self) -> str:
        return f"<Tangents {self.equations.model.name}: {', '.join(self.programs.programs)}>"

    def __reduce__(self) -> tuple[type[Tangents], tuple[TangentPrograms, Terms]]:
        """Pickled as programs, which are compiled again where they arrive."""
        return type(self), (self.programs, self.equations)

    @classmethod
    def by_state(cls, programs: Programs) -> Self:
        """stiffness, damping, phidd_q and phidd_qd."""

        def made(equations: Terms) -> TangentPrograms:
            from ncgen.program.differentiation.tangent_programs import assemble_tangents

            return assemble_tangents(equations, programs.emission)

        return cls._of(kept_tangents(programs, "tangents", made), programs)

    @classmethod
    def by_parameters(cls, programs: Programs) -> Self:
        """phi_p, phid_p, phidd_p and balance_p."""

        def made() -> TangentPrograms:
            from ncgen.program.differentiation.tangent_programs import assemble_parameter_tangents

            return assemble_parameter_tangents(programs.equations)

        return cls._of(recall.derived_tangents(programs, "parameter_tangents", made), programs)

    @classmethod
    def _of(cls, tangents: TangentPrograms, programs: Programs) -> Self:
        """Those of a mechanism; programs: its own."""
        return cls(tangents, programs.equations)

    def values(self, name: str, arguments: dict[str, Any]) -> np.ndarray:
        """The nonzeros of one matrix; arguments: t, q, qd, qdd, lam, p by name."""
        program = self.programs.programs.get(name)
        if program is None:
            return np.zeros(0)
        return self._call(name, program, [arguments[a] for a in program.inputs])

    @abstractmethod
    def _call(self, name: str, program: Program, inputs: list[Any]) -> np.ndarray:
        """The output of a program; inputs: time and arrays, in the order of the program's."""


class NumPyTangents(Tangents):
    """Through the generated NumPy source; takes batches and complex numbers."""

    @cached_property
    def _functions(self) -> dict[str, Any]:
        return executed(in_numpy.tangent_files(self.programs, self.equations))

    def _call(self, name: str, program: Program, inputs: list[Any]) -> np.ndarray:
        with np.errstate(all="ignore"):  # as in C, what is no number says so by itself
            return self._functions[name](*inputs)


class CompiledTangents(Tangents):
    """Through a compiled library, whose `descriptor` the C runtime takes; the first calls of each kernel compute its program as it stands.

    source: gives the C source, asked for when the library is needed
    """

    def __init__(self, programs: TangentPrograms, equations: Terms, source: Callable[[], Files] | None = None) -> None:
        super().__init__(programs, equations)
        self._source = source or (lambda: in_c.tangent_files(programs, equations))
        self._calls: Counter[str] = Counter()
        n, rows, parameters = len(equations.free), len(equations.model.rows), len(equations.parameters)
        self._counts = {"q": n, "qd": n, "qdd": n, "lam": rows, "p": parameters}

    @classmethod
    def _of(cls, tangents: TangentPrograms, programs: Programs) -> Self:
        def source() -> Files:
            return recall.derived(programs, f"{tangents.kind} in C", lambda: in_c.tangent_files(tangents, programs.equations))

        return cls(tangents, programs.equations, source)

    @cached_property
    def _loaded(self) -> tuple[Interface, InC, InC]:
        """What passes arguments, the library, which has to stay, and the descriptor in it."""
        files, kind = self._source(), self.programs.kind
        getter = f"{prefix_of(self.equations.model.name)}_{kind}"
        ffi, library = load(files | runtime_files(*HEADERS), f"const ncgen_{kind} *{getter}(void);", abi(), flags_for(files))
        return ffi, library, getattr(library, getter)()

    @property
    def descriptor(self) -> InC:
        """The struct of these kernels in C."""
        return self._loaded[-1]

    def _call(self, name: str, program: Program, inputs: list[Any]) -> np.ndarray:
        self._calls[name] += 1
        if self._calls[name] <= FEW_CALLS and (values := self._computed(program, inputs)) is not None:
            return values
        return self._called(name, program, inputs)

    @staticmethod
    def _computed(program: Program, inputs: list[Any]) -> np.ndarray | None:
        """The output of a program without a compiler; None where it is not finite, which C has its own words for."""
        if not isinstance(inputs[0], (int, float)):
            return None
        arrays = [array.tolist() for array in inputs[1:]]
        try:
            return np.array(evaluate(program, dict(zip(program.inputs, [float(inputs[0]), *arrays], strict=True))), dtype=float)
        except (ArithmeticError, ValueError):
            return None

    def _called(self, name: str, program: Program, inputs: list[Any]) -> np.ndarray:
        ffi, _, descriptor = self._loaded
        out = np.empty(program.size)
        pairs = zip(program.inputs[1:], inputs[1:], strict=True)  # `Kernels` has laid them out
        pointers = [pointer(ffi, array, "double[]", self._counts[of], of) for of, array in pairs]
        try:
            getattr(descriptor, name)(inputs[0], *pointers, pointer(ffi, out))
        except TypeError:
            raise NcgenError(f"{self.equations.model.name}.{name}: t is {inputs[0]!r}; compiled kernels take one real number") from None
        return out
