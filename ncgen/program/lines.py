"""A mechanism in one straight line: every term unrolled, whatever is common to several of them computed once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

from ncgen.model.traced_numbers import Traced
from ncgen.model.values import Value, as_sympy, is_number
from ncgen.program.algebra.elimination import Matrix
from ncgen.program.assemble import parts_of, place_of
from ncgen.program.binding import BoundTerm, Derived, Reference, bind
from ncgen.program.ir.angles import share_angles
from ncgen.program.ir.blocks import Phases, Program, written
from ncgen.program.ir.cut import cut, cut_into_phases
from ncgen.program.ir.finishing import finish
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.lower import lower_value
from ncgen.program.ir.passes import dead_code
from ncgen.program.kernel_table import Kernel
from ncgen.program.labels import labelled_errors, load_name
from ncgen.symbolic.inertia import Exact
from ncgen.symbolic.numbering import Terms

if TYPE_CHECKING:
    import sympy


class Lines:
    """All terms of a mechanism written into one graph, a new one unless it is given.

    coordinates, rates: nodes of q and qd; loads of these unless something else is put in their place
    """

    def __init__(self, equations: Terms, graph: Graph | None = None) -> None:
        self.equations = equations
        self.graph = Graph() if graph is None else graph
        self.derived = Derived()
        self.coordinates: list[int] = [self.graph.load("q", i) for i in range(len(equations.free))]
        self.rates: list[int] = [self.graph.load("qd", i) for i in range(len(equations.free))]
        self._parameters: dict[str, int] | None = None

    def gather(self, kernel: Kernel) -> dict[tuple[int, ...], int]:
        """{place: node} of a kernel's output, contributions added up, structural zeros left out."""
        sums: dict[tuple[int, ...], list[int]] = defaultdict(list)
        for term in kernel.terms(self.equations):
            with labelled_errors(term.label):
                bound = bind(term, self.equations, self.derived)
            for position, node in parts_of(kernel, bound, self.graph, partial(self._read, bound)):
                sums[place_of(position, bound, self.equations)].append(node)
        return {position: self.graph.sum(nodes) for position, nodes in sums.items()}

    def vector(self, kernel: Kernel) -> dict[int, int]:
        """{number: node} of a kernel whose output is a vector."""
        return {i: node for (i,), node in self.gather(kernel).items()}

    def matrix(self, kernel: Kernel) -> Matrix:
        """{(row, column): node} of a kernel whose output is a matrix."""
        return {(i, j): node for (i, j), node in self.gather(kernel).items()}

    def _read(self, bound: BoundTerm, reference: Reference) -> int:
        kind, k = reference
        if kind == "const":
            return self.graph.const(bound.constants[k])
        if kind == "p":
            array, index = bound.parameters[k]
            return self.graph.load("p", index) if array == "p" else self._expression(index)
        if kind == "lam":
            return self.graph.load("lam", bound.row)
        position = self.equations.index[bound.coordinates[k]]
        if kind == "q":
            return self.coordinates[position]
        return self.rates[position] if kind == "qd" else self.graph.load(kind, position)

    def value(self, value: Value | Exact) -> int:
        """A number, or an expression of parameters."""
        if isinstance(value, Traced):
            return self.graph.const(value)
        return self.graph.const(float(value)) if is_number(value) or isinstance(value, Fraction) else self._lowered(as_sympy(value))

    def _expression(self, index: int) -> int:
        return self._lowered(self.derived.expressions[index])

    def _lowered(self, expression: sympy.Expr) -> int:
        if self._parameters is None:
            self._parameters = {p.name: self.graph.load("p", i) for i, p in enumerate(self.equations.parameters)}
        return lower_value(self.graph, expression, self._parameters)

    def program(self, name: str, inputs: tuple[str, ...], outputs: Sequence[int]) -> Program:
        """A program that writes these nodes one after the other."""
        return line(self.graph, name, inputs, outputs, self.equations)

    def draft(self, name: str, inputs: tuple[str, ...], outputs: Sequence[int], phases: Phases | None = None) -> Program:
        """The same as it was written, for `prepared.take_out` to finish. phases: as of `Program`"""
        block = dead_code(written(self.graph, name, outputs))
        return Program(name=name, inputs=inputs, output=name, size=len(outputs), blocks=(block,), phases=phases)


def line(
    graph: Graph, name: str, inputs: tuple[str, ...], outputs: Sequence[int], equations: Terms, phases: Phases | None = None
) -> Program:
    """A program in one straight line that writes nodes of a graph one after the other. phases: as of `Program`"""
    names = {k: load_name(*op.input, equations) for k, op in enumerate(graph.ops) if op.code == "load"}
    block = finish(replace(written(graph, name, outputs), names=names))
    program = share_angles(Program(name=name, inputs=inputs, output=name, size=len(outputs), blocks=(block,), phases=phases))
    return cut_into_phases(program) if phases else cut(program)
