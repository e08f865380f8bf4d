"""Sums of products that are not written yet: what a factor is common to, what is left inside of it and outside.

Products are binary, as they were written, and so are sums: what is taken out leaves the rest in its order.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

Product: TypeAlias = "int | tuple[Product, Product]"
"""A node, or the product of two."""


class SignedProduct(NamedTuple):
    """A product with a sign; shared: the number of the operation that it is, if several sums read it."""

    is_negative: bool
    product: Product
    shared: int | None = None

    @property
    def size(self) -> int:
        return 1

    def negated(self) -> SignedProduct:
        is_negative, product, shared = self
        return tuple.__new__(SignedProduct, (not is_negative, product, shared))

    def has(self, factor: int) -> bool:
        """Whether it is a product of the factor and of something else."""
        return not isinstance(self.product, int) and factor in factors(self.product)


class Sum(NamedTuple):
    """What two sums or terms add up to; size: how many terms."""

    left: Form
    right: Form
    size: int

    def negated(self) -> Sum:
        return Sum(self.left.negated(), self.right.negated(), self.size)


Form: TypeAlias = SignedProduct | Sum


def added(left: Form, right: Form) -> Sum:
    return tuple.__new__(Sum, (left, right, left.size + right.size))


def terms(form: Form) -> list[SignedProduct]:
    """From left to right."""
    forms: list[SignedProduct] = []
    waiting = [form]
    while waiting:
        form = waiting.pop()
        if isinstance(form, SignedProduct):
            forms.append(form)
        else:
            left, right, _ = form
            waiting += (right, left)
    return forms


def factors(product: Product) -> list[int]:
    """From left to right; a square has one twice."""
    if isinstance(product, int):
        return [product]
    if isinstance(product[0], int) and isinstance(product[1], int):
        return [product[0], product[1]]
    products: list[int] = []
    waiting: list[Product] = [product]
    while waiting:
        product = waiting.pop()
        if isinstance(product, int):
            products.append(product)
        else:
            waiting += product[::-1]
    return products


def inside(form: Form, factor: int) -> Form | None:
    """What of a sum is multiplied by the factor; None if nothing is."""
    if isinstance(form, SignedProduct):
        rest = _over(form.product, factor) if form.has(factor) else None
        return None if rest is None else SignedProduct(form.is_negative, rest)
    return _joined(inside(form.left, factor), inside(form.right, factor))


def outside(form: Form, factor: int, waiting: list[SignedProduct]) -> Form | None:
    """A sum with the waiting term for those that have the factor, in the place of the last of them: nothing is added later than it was."""
    if isinstance(form, SignedProduct):
        return form if not form.has(factor) else waiting.pop() if waiting else None
    right = outside(form.right, factor, waiting)
    return _joined(outside(form.left, factor, waiting), right)


def _over(product: Product, factor: int) -> Product | None:
    """A product that has the factor without it; None where that is all."""
    if isinstance(product, int):
        return None
    left, right = product
    if factor in factors(left):
        rest = _over(left, factor)
        return right if rest is None else (rest, right)
    rest = _over(right, factor)
    return left if rest is None else (left, rest)


def _joined(left: Form | None, right: Form | None) -> Form | None:
    if left is None or right is None:
        return right if left is None else left
    return added(left, right)
