"""Common factors of sums, taken out: a x + a z becomes a (x + z), which is a multiplication less.

A factor is taken out where that saves one: of its products at least one is read by this sum alone. Products that several sums read come
along where they do so in all of them. The factor of most terms goes first, then those of what is left inside and outside. What is added
keeps its order.

Rounding: the products of a sum are wrong by roundings of their own size already, so it does not matter which of them are added first. Those
with a power of two are not; that is taken out of a whole sum alone, which has the same bits then. Differences of anything but products stay
as they are.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import TypeVar

from ncgen.program.ir.blocks import Block
from ncgen.program.ir.graph import Graph, Op
from ncgen.program.ir.multiples import MAX_TERMS, is_exact, is_known
from ncgen.program.ir.passes import dead_code, operations, uses
from ncgen.program.ir.sums import Form, Product, SignedProduct, Sum, added, factors, inside, outside, terms

B = TypeVar("B", bound=Block)

MAX_FACTORED_OPERATIONS = 5000
"""Operations above which shared products are left where they are: all stay, or all but a few that would save 2 operations in 10,000, and
finding that out takes a second look at every sum."""

SUMS = frozenset({"add", "sub", "neg"})
"""Codes of what adds up."""

MIN_SAVING = 0.02
"""The share of operations that a round has to save for another one: in long programs it would find next to nothing."""


def factored(block: B, parameters: int = 0) -> B:
    """The block with common factors taken out of its sums, as long as that leaves fewer operations.

    parameters: how many numbers of p are known; what depends on them alone is computed before, and stays together
    """
    while (count := operations(made := _once(block, parameters))) < (before := operations(block)):
        block = made
        if before - count < MIN_SAVING * before:
            break
    return block


def _once(block: B, parameters: int) -> B:
    """Every sum looked at once; shared products that would stay are left where they are."""
    shared = _shared(block) if len(block.ops) <= MAX_FACTORED_OPERATIONS else set()
    while True:
        work = _Factoring(block, shared, parameters)
        stores = tuple([s.of(work.node(s.node)) for s in block.stores])
        if not work.stayed:
            names = {work.node(k): name for k, name in block.names.items() if not block.ops[k].args}
            return dead_code(replace(block, ops=tuple(work.graph.ops), stores=stores, names=names))
        shared -= work.stayed


def _shared(block: Block) -> set[int]:
    """Products that are read by several, all of which are sums."""
    others = {s.node for s in block.stores} | {a for op in block.ops if op.code not in ("add", "sub") for a in op.args}
    return {k for k, n in uses(block).items() if n > 1 and block.ops[k].code == "mul" and k not in others}


def _term(is_negative: bool, product: Product) -> SignedProduct:
    """A term that no other sum shares, in a third of the time that calling `SignedProduct` takes."""
    return tuple.__new__(SignedProduct, (is_negative, product, None))


class _Factoring:
    """A graph that grows by a block's operations; sums and products that are read by one of them are held until it is written.

    stayed: shared products that had to be written
    """

    def __init__(self, block: Block, shared: Collection[int], parameters: int) -> None:
        self.graph = Graph()
        self.stayed: set[int] = set()
        self._shared, self._count = shared, uses(block)
        self._reader = {a: op.code for op in block.ops for a in op.args}
        self._forms: list[Form] = []
        self._known: list[bool] = []
        known, forms = self._known, self._forms
        for number, op in enumerate(block.ops):
            if op.args:
                known.append(all([known[a] for a in op.args]))
                forms.append(self._held(number, self._form(op, [forms[a] for a in op.args])))
            else:
                known.append(is_known(op, (), parameters))
                forms.append(_term(False, self.graph.copied(op, ())))

    def node(self, number: int) -> int:
        """An operation in the grown graph."""
        return self._written(self._forms[number])

    def _form(self, op: Op, arguments: Sequence[Form]) -> Form:
        """An operation on its arguments; sums and products are not written."""
        if op.code == "add":
            return added(arguments[0], arguments[1])
        if op.code == "sub":
            return added(arguments[0], arguments[1].negated())
        if op.code == "neg":
            return arguments[0].negated()
        if op.code == "mul":
            (is_negative, a, _), (is_other_negative, b, _) = map(self._term, arguments)
            return _term(is_negative != is_other_negative, (a, b))
        return _term(False, self.graph.copied(op, list(map(self._written, arguments))))

    def _held(self, number: int, form: Form) -> Form:
        """What stays unwritten of it: all in a sum, its factors in a product, nothing where others or several read it, or it is known."""
        reader = None if self._known[number] or self._count[number] != 1 else self._reader.get(number)
        if reader in SUMS and (isinstance(form, SignedProduct) or form.size <= MAX_TERMS):
            return form
        term = self._term(form)
        is_shared = number in self._shared and not self._known[number]
        if (is_shared or reader in SUMS or reader == "mul") and len(factors(term.product)) <= MAX_TERMS:
            return term._replace(shared=number) if is_shared else term
        return _term(term.is_negative, self._product(term.product))

    # -- sums ----------------------------------------------------------------------------------

    def _term(self, form: Form) -> SignedProduct:
        """A sum as one term, its common factors outside."""
        while not isinstance(form, SignedProduct):
            if (factor := self._common(form)) is None:
                return _term(*self._added(form))
            form = self._without(form, factor)
        return form

    def _without(self, form: Sum, factor: int) -> Form:
        """A sum whose terms with a factor are one, the factor times what was inside."""
        within = inside(form, factor)
        assert within is not None, "a common factor has something inside"
        inner = self._term(within)
        changed = outside(form, factor, [SignedProduct(inner.is_negative, (factor, inner.product))])
        assert changed is not None, "that is one of its terms"
        return changed

    def _common(self, form: Sum) -> int | None:
        """The factor of most products in a sum, the first of them; None where none saves anything."""
        products = [term for term in terms(form) if not isinstance(term.product, int)]
        if len(products) < 2:
            return None
        count, unshared = dict[int, int](), set[int]()
        for term in products:
            for factor in dict.fromkeys(factors(term.product)):
                count[factor] = count.get(factor, 0) + 1
                if term.shared is None:
                    unshared.add(factor)
        common = {f: n for f, n in count.items() if n > 1 and f in unshared and (n == form.size or not is_exact(self.graph.ops[f]))}
        return max(common, key=common.__getitem__, default=None)

    # -- writing -------------------------------------------------------------------------------

    def _added(self, form: Form) -> tuple[bool, int]:
        """A sum, written, and its sign: that of all terms, if they have the same."""
        if isinstance(form, SignedProduct):
            if form.shared is not None:
                self.stayed.add(form.shared)
            return form.is_negative, self._product(form.product)
        (minus, a), (also, b) = self._added(form.left), self._added(form.right)
        if minus == also:
            return minus, self.graph.add(a, b)
        return False, self.graph.sub(b, a) if minus else self.graph.sub(a, b)

    def _product(self, product: Product) -> int:
        if isinstance(product, int):
            return product
        a, b = product
        return self.graph.mul(a if isinstance(a, int) else self._product(a), b if isinstance(b, int) else self._product(b))

    def _written(self, form: Form) -> int:
        term = self._term(form)
        node = self._product(term.product)
        return self.graph.neg(node) if term.is_negative else node
