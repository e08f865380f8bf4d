"""Conditions as formulas that C evaluates between bounds (`ncgen_formula.c`): lists of few kinds of operations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ncgen.model.values import Scalar
from ncgen.program.ir.graph import PIECES, Graph, Op
from ncgen.program.lines import Lines
from ncgen.program.motions.expression_nodes import expression_node
from ncgen.symbolic.numbering import Terms

KINDS = (
    "const", "state", "t", "p", "add", "sub", "mul", "div", "neg", "sqrt", "sin", "cos", "exp", "log", "atan2", "abs", "sign", PIECES,
)  # fmt: skip
"""Operations of formulas in the order of NCGEN_FORMULA_…; "state" is an element of q or q̇."""

MAX_OPERATIONS = 300
"""Operations beyond which a condition has no formula: bounding it would cost more than the step."""

Formula = tuple[tuple[int, int, int], ...]
"""Of every operation its kind, and a and b as `ncgen_formulas` has them."""


@dataclass(frozen=True)
class FormulaTable:
    """formulas: of every condition, empty for one that has none; numbers: what they read; inputs: positions in q, or n + position in q̇"""

    formulas: tuple[Formula, ...]
    numbers: tuple[float, ...]
    inputs: tuple[int, ...]


def assemble_formulas(equations: Terms, conditions: Sequence[tuple[str, Scalar] | None]) -> FormulaTable:
    """Return the formulas of conditions. conditions: (what messages call it, expression), None for one that needs no formula

    Raises ModelError where one mentions what the model does not have.
    """
    table = _Table(len(equations.free))
    formulas = tuple(table.formula(_simple(equations, *each)) if each else () for each in conditions)
    return FormulaTable(formulas, tuple(table.numbers), tuple(table.inputs))


def _simple(equations: Terms, where: str, expression: Scalar) -> tuple[Graph, int]:
    """A condition in the operations of KINDS."""
    lines, graph = Lines(equations), Graph()
    node, new = expression_node(lines, where, expression), dict[int, int]()
    for operand in sorted(lines.graph.below([node])):
        op = lines.graph.ops[operand]
        arguments = [new[a] for a in op.args]
        rule = RULES.get(op.code)
        new[operand] = rule(graph, *arguments) if rule else graph.copied(op, arguments)
    return graph, new[node]


class _Table:
    """Formulas as they are gathered. n: number of coordinates"""

    def __init__(self, n: int) -> None:
        self.n, self.numbers, self.inputs = n, list[float](), list[int]()

    def formula(self, simple: tuple[Graph, int]) -> Formula:
        graph, node = simple
        parts = sorted(graph.below([node]))
        if len(parts) > MAX_OPERATIONS:
            return ()
        local = {operand: k for k, operand in enumerate(parts)}
        return tuple(self._operation(graph.ops[operand], local) for operand in parts)

    def _operation(self, op: Op, local: dict[int, int]) -> tuple[int, int, int]:
        if op.code == "const":
            return KINDS.index("const"), self._number([op.value]), 0
        if op.code == "load":
            return self._input(*op.input)
        if op.code == PIECES:
            pieces = op.pieces
            position = self._number([len(pieces.knots), pieces.degree, pieces.period, *pieces.knots, *pieces.numbers])
            return KINDS.index(PIECES), local[op.args[0]], position
        a, *others = (local[each] for each in op.args)
        return KINDS.index(op.code), a, others[0] if others else a

    def _input(self, array: str, position: int) -> tuple[int, int, int]:
        if array in ("t", "p"):
            return KINDS.index(array), position, 0
        index = position if array == "q" else self.n + position
        if index not in self.inputs:
            self.inputs.append(index)
        return KINDS.index("state"), self.inputs.index(index), 0

    def _number(self, numbers: Sequence[float]) -> int:
        self.numbers += map(float, numbers)
        return len(self.numbers) - len(numbers)


def _tan(g: Graph, x: int) -> int:
    return g.div(g.call("sin", x), g.call("cos", x))


def _other_leg(g: Graph, x: int) -> int:
    return g.call("sqrt", g.sub(g.const(1.0), g.mul(x, x)))


def _growing_and_falling(g: Graph, x: int) -> tuple[int, int]:
    """Halves of exp(x) and exp(-x)."""
    half = g.const(0.5)
    return g.mul(half, g.call("exp", x)), g.mul(half, g.call("exp", g.neg(x)))


def _tanh(g: Graph, x: int) -> int:
    one, two = g.const(1.0), g.const(2.0)
    return g.sub(one, g.div(two, g.add(g.call("exp", g.mul(two, x)), one)))


RULES: dict[str, Callable[..., int]] = {
    "tan": _tan,
    "asin": lambda g, x: g.call("atan2", x, _other_leg(g, x)),
    "acos": lambda g, x: g.call("atan2", _other_leg(g, x), x),
    "atan": lambda g, x: g.call("atan2", x, g.const(1.0)),
    "sinh": lambda g, x: g.sub(*_growing_and_falling(g, x)),
    "cosh": lambda g, x: g.add(*_growing_and_falling(g, x)),
    "tanh": _tanh,
    "pow": lambda g, a, b: g.call("exp", g.mul(b, g.call("log", a))),
}
"""How other functions are made of those of KINDS."""
