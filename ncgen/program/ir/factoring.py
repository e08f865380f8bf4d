"""Common factors of sums, taken out: a x + a z becomes a (x + z), which is a multiplication less.

What is computed for others as well stays: factors are looked for in products that only their sum reads, and the sum keeps the order of its
terms. The factor of most terms goes first, then those of what is left inside and outside.

Rounding: the products of a sum are wrong by roundings of their own size already, so it does not matter which of them are added first. Those
with a power of two are not; that is taken out of a whole sum alone, which has the same bits then. Differences of anything but products stay
as they are.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple, TypeAlias, TypeVar

from ncgen.program.ir.blocks import Block
from ncgen.program.ir.graph import Graph, Op
from ncgen.program.ir.passes import dead_code, uses

B = TypeVar("B", bound=Block)

LARGEST = 100
"""Terms of a sum, or factors of a product, that are looked at together: longer ones are taken in parts."""

SUMS = ("add", "sub", "neg")

Product: TypeAlias = "int | tuple[Product, Product]"
"""A node, or the product of two."""


class Term(NamedTuple):
    """A product with a sign, not written yet."""

    is_negative: bool
    product: Product

    @property
    def size(self) -> int:
        return 1

    def negated(self) -> Term:
        return Term(not self.is_negative, self.product)


class Sum(NamedTuple):
    """What two sums or terms add up to, not written yet; size: how many terms."""

    left: Form
    right: Form
    size: int

    def negated(self) -> Sum:
        return Sum(self.left.negated(), self.right.negated(), self.size)


Form: TypeAlias = Term | Sum


def factored(block: B) -> B:
    """The block with common factors taken out of its sums, as long as that leaves fewer operations."""
    while _operations(made := dead_code(_Factoring(block).made())) < _operations(block):
        block = made
    return block


def _operations(block: Block) -> int:
    return sum(bool(op.args) for op in block.ops)


class _Factoring:
    """A graph that grows by a block's operations; sums and products that one of them alone reads are held until it is written."""

    def __init__(self, block: B) -> None:
        self.block, self.graph = block, Graph()
        self._count = uses(block)
        self._reader = {a: op.code for op in block.ops for a in op.args}

    def made(self) -> B:
        forms: list[Form] = []
        for number, op in enumerate(self.block.ops):
            forms.append(self._held(number, self._form(op, [forms[a] for a in op.args])))
        stores = tuple([replace(s, node=self._written(forms[s.node])) for s in self.block.stores])
        names = {product: self.block.names[k] for k, (_, product, *_) in enumerate(forms) if k in self.block.names and isinstance(product, int)}
        return replace(self.block, ops=tuple(self.graph.ops), stores=stores, names=names)

    def _form(self, op: Op, arguments: list[Form]) -> Form:
        """An operation on its arguments; sums and products are not written."""
        if op.code in ("add", "sub"):
            left, right = arguments
            return Sum(left, right if op.code == "add" else right.negated(), left.size + right.size)
        if op.code == "neg":
            return arguments[0].negated()
        if op.code == "mul":
            (minus, a), (also, b) = map(self._term, arguments)
            return Term(minus != also, (a, b))
        return Term(False, self._leaf(op) if not op.args else self.graph.apply(op, tuple(map(self._written, arguments))))

    def _leaf(self, op: Op) -> int:
        if op.code == "const":
            return self.graph.const(op.value)
        return self.graph.slot(op.slot) if op.code == "slot" else self.graph.load(*op.input)

    def _held(self, number: int, form: Form) -> Form:
        """What stays unwritten of it: all in a sum, its factors in a product, nothing where several or others read it."""
        reader = self._reader.get(number) if self._count[number] == 1 else None
        if reader in SUMS and form.size <= LARGEST:
            return form
        term = self._term(form)
        if reader in (*SUMS, "mul") and len(list(_factors(term.product))) <= LARGEST:
            return term
        return Term(term.is_negative, self._node(term.product))

    # -- sums ----------------------------------------------------------------------------------

    def _term(self, form: Form) -> Term:
        """A sum as one term, its common factors outside."""
        while isinstance(form, Sum) and (factor := self._common(form)) is not None:
            inside = self._term(_inside(form, factor))
            form = _outside(form, factor, [Term(inside.is_negative, (factor, inside.product))])
        return self._added(form) if isinstance(form, Sum) else form

    def _common(self, form: Sum) -> int | None:
        """The factor of most products in a sum, the first of them; None if all have different ones."""
        count = Counter(factor for term in _terms(form) for factor in dict.fromkeys(_factors(term.product)) if _has(term, factor))
        found = {factor: n for factor, n in count.items() if n > 1 and (n == form.size or not self._is_exact(factor))}
        return max(found, key=found.__getitem__, default=None)

    def _is_exact(self, node: int) -> bool:
        """Whether a product with it is not rounded."""
        value = self.graph.value(node)
        return value is not None and math.frexp(abs(value))[0] == 0.5

    def _added(self, form: Form) -> Term:
        """A sum, written: the first sign of several is that of the term."""
        if isinstance(form, Term):
            return Term(form.is_negative, self._node(form.product))
        (minus, a), (also, b) = self._added(form.left), self._added(form.right)
        if minus == also:
            return Term(minus, self.graph.add(a, b))
        return Term(False, self.graph.sub(b, a) if minus else self.graph.sub(a, b))

    # -- writing -------------------------------------------------------------------------------

    def _node(self, product: Product) -> int:
        return product if isinstance(product, int) else self.graph.mul(*map(self._node, product))

    def _written(self, form: Form) -> int:
        term = self._term(form)
        node = self._node(term.product)
        return self.graph.neg(node) if term.is_negative else node


def _terms(form: Form) -> Iterator[Term]:
    if isinstance(form, Term):
        yield form
    else:
        yield from _terms(form.left)
        yield from _terms(form.right)


def _factors(product: Product) -> Iterator[int]:
    if isinstance(product, int):
        yield product
    else:
        yield from _factors(product[0])
        yield from _factors(product[1])


def _has(term: Term, factor: int) -> bool:
    """Whether it is a product of the factor and of something else."""
    return not isinstance(term.product, int) and factor in _factors(term.product)


def _over(product: Product, factor: int) -> Product | None:
    """A product without one of its factors; None where that is all."""
    if isinstance(product, int):
        return None if product == factor else product
    left, right = product
    if factor in _factors(left):
        rest = _over(left, factor)
        return right if rest is None else (rest, right)
    rest = _over(right, factor)
    return left if rest is None else (left, rest)


def _inside(form: Form, factor: int) -> Form | None:
    """What of a sum is multiplied by the factor, in the same order."""
    if isinstance(form, Term):
        if not _has(form, factor):
            return None
        rest = _over(form.product, factor)
        assert rest is not None
        return Term(form.is_negative, rest)
    return _joined(_inside(form.left, factor), _inside(form.right, factor))


def _joined(left: Form | None, right: Form | None) -> Form | None:
    if left is None or right is None:
        return right if left is None else left
    return Sum(left, right, left.size + right.size)


def _outside(form: Form, factor: int, waiting: list[Term]) -> Form | None:
    """A sum with the waiting term in the place of those that have the factor: of the last of them, since what is added last is needed last."""
    if isinstance(form, Term):
        return form if not _has(form, factor) else waiting.pop() if waiting else None
    right = _outside(form.right, factor, waiting)
    return _joined(_outside(form.left, factor, waiting), right)
