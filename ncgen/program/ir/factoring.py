"""Common factors of sums, taken out: a x + a z becomes a (x + z), which is a multiplication less.

A factor goes where it saves one: among its products at least one is read by this sum alone. Products that several sums read come
along where they do so in all of them. The factor of most terms goes first, then those of what is left inside and outside. What is added
keeps its order.

Rounding: the products of a sum are wrong by roundings of their own size already, so it does not matter which of them are added first. Those
with a power of two are not; that is taken out of a whole sum alone, which has the same bits then. Differences of anything but products stay
as they are.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import NamedTuple, TypeAlias, TypeVar

from ncgen.program.ir.blocks import Block
from ncgen.program.ir.graph import Graph, Op
from ncgen.program.ir.passes import dead_code, uses

B = TypeVar("B", bound=Block)

LARGEST = 100
"""Terms of a sum, or factors of a product, that are looked at together: longer ones are taken in parts."""

Product: TypeAlias = "int | tuple[Product, Product]"
"""A node, or the product of two."""


class Term(NamedTuple):
    """A product with a sign, not written yet; shared: the operation that it is, if several sums read it."""

    is_negative: bool
    product: Product
    shared: int | None = None

    @property
    def size(self) -> int:
        return 1

    def negated(self) -> Term:
        return self._replace(is_negative=not self.is_negative)


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
    while _operations(made := _once(block)) < _operations(block):
        block = made
    return block


def _operations(block: Block) -> int:
    return sum(bool(op.args) for op in block.ops)


def _once(block: B) -> B:
    """Every sum looked at once, without the shared products that would stay."""
    shared = _shared(block)
    while True:
        work = _Factoring(block, shared)
        made = work.made()
        if not work.stayed:
            return dead_code(made)
        shared -= work.stayed


def _shared(block: Block) -> set[int]:
    """Products that are read by several, all of which are sums."""
    others = {s.node for s in block.stores} | {a for op in block.ops if op.code not in ("add", "sub") for a in op.args}
    return {k for k, n in uses(block).items() if n > 1 and block.ops[k].code == "mul" and k not in others}


class _Factoring:
    """A graph that grows by a block's operations; sums and products that are read by one of them are held until it is written.

    stayed: shared products that had to be written
    """

    def __init__(self, block: Block, shared: Collection[int]) -> None:
        self.block, self.graph = block, Graph()
        self.stayed: set[int] = set()
        self._shared, self._count = shared, uses(block)
        self._reader = {a: op.code for op in block.ops for a in op.args}

    def made(self) -> Block:
        """The block on the grown graph."""
        forms: list[Form] = []
        for number, op in enumerate(self.block.ops):
            forms.append(self._held(number, self._form(op, [forms[a] for a in op.args])))
        stores = tuple([replace(s, node=self._written(forms[s.node])) for s in self.block.stores])
        names = {self._node(forms[k].product): name for k, name in self.block.names.items() if not self.block.ops[k].args}
        return replace(self.block, ops=tuple(self.graph.ops), stores=stores, names=names)

    def _form(self, op: Op, arguments: list[Form]) -> Form:
        """An operation on its arguments; sums and products are not written."""
        if op.code in ("add", "sub"):
            left, right = arguments
            return Sum(left, right if op.code == "add" else right.negated(), left.size + right.size)
        if op.code == "neg":
            return arguments[0].negated()
        if op.code == "mul":
            (minus, a, _), (also, b, _) = map(self._term, arguments)
            return Term(minus != also, (a, b))
        return Term(False, self.graph.apply(op, tuple(map(self._written, arguments))) if op.args else self._leaf(op))

    def _leaf(self, op: Op) -> int:
        if op.code == "const":
            return self.graph.const(op.value)
        return self.graph.slot(op.slot) if op.code == "slot" else self.graph.load(*op.input)

    def _held(self, number: int, form: Form) -> Form:
        """What stays unwritten of it: all in a sum, its factors in a product, nothing where several or others read it."""
        reader = self._reader.get(number) if self._count[number] == 1 else None
        if reader in ("add", "sub", "neg") and form.size <= LARGEST:
            return form
        term = self._term(form)
        if len(list(_factors(term.product))) <= LARGEST:
            if reader in ("add", "sub", "neg", "mul"):
                return term
            if number in self._shared:
                return term._replace(shared=number)
        return Term(term.is_negative, self._node(term.product))

    # -- sums ----------------------------------------------------------------------------------

    def _term(self, form: Form) -> Term:
        """A sum as one term, its common factors outside."""
        while isinstance(form, Sum) and (factor := self._common(form)) is not None:
            inside = self._term(_inside(form, factor))
            form = _outside(form, factor, [Term(inside.is_negative, (factor, inside.product))])
        return self._added(form) if isinstance(form, Sum) else form

    def _common(self, form: Sum) -> int | None:
        """The factor of most products in a sum, the first of them; None where none saves anything."""
        count, own = Counter[int](), set[int]()
        for term in _terms(form):
            if not isinstance(term.product, int):
                factors = dict.fromkeys(_factors(term.product))
                count.update(list(factors))
                own.update(factors if term.shared is None else ())
        found = {f: n for f, n in count.items() if n > 1 and f in own and (n == form.size or not self._is_exact(f))}
        return max(found, key=found.__getitem__, default=None)

    def _is_exact(self, node: int) -> bool:
        """Whether a product with it is not rounded."""
        value = self.graph.value(node)
        return value is not None and math.frexp(abs(value))[0] == 0.5

    def _added(self, form: Form) -> Term:
        """A sum, written: the first sign of several is that of the term."""
        if isinstance(form, Term):
            return Term(form.is_negative, self._whole(form))
        (minus, a, _), (also, b, _) = self._added(form.left), self._added(form.right)
        if minus == also:
            return Term(minus, self.graph.add(a, b))
        return Term(False, self.graph.sub(b, a) if minus else self.graph.sub(a, b))

    # -- writing -------------------------------------------------------------------------------

    def _whole(self, term: Term) -> int:
        if term.shared is not None:
            self.stayed.add(term.shared)
        return self._node(term.product)

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
        rest = _over(form.product, factor) if _has(form, factor) else None
        return None if rest is None else Term(form.is_negative, rest)
    return _joined(_inside(form.left, factor), _inside(form.right, factor))


def _outside(form: Form, factor: int, waiting: list[Term]) -> Form | None:
    """A sum with the waiting term in the place of those that have the factor: of the last of them, since what is added last is needed last."""
    if isinstance(form, Term):
        return form if not _has(form, factor) else waiting.pop() if waiting else None
    right = _outside(form.right, factor, waiting)
    return _joined(_outside(form.left, factor, waiting), right)


def _joined(left: Form | None, right: Form | None) -> Form | None:
    """What is left of a sum whose sides may have gone."""
    if left is None or right is None:
        return right if left is None else left
    return Sum(left, right, left.size + right.size)
