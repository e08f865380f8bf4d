"""Labels: what a reader calls the inputs and terms of a program, in comments and in errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ncgen.errors import ModelError
from ncgen.program.binding import BoundTerm, Reference
from ncgen.symbolic.numbering import Terms


@contextmanager
def labelled_errors(label: str) -> Iterator[None]:
    """Whatever is wrong with the numbers or the words of a term is a ModelError with the term's own label in front."""
    try:
        yield
    except ModelError as error:
        raise error if str(error).startswith(label) else ModelError(f"{label}: {error}") from None
    except ArithmeticError as error:
        raise ModelError(f"{label}: {error}; correct the expression, or the numbers and fixed coordinates in it") from None
    except ValueError as error:
        raise ModelError(f"{label}: {error} at its numbers and fixed coordinates; correct the expression") from None


MARKS = {"qd": "d", "qdd": "dd"}
"""What stands before a coordinate's name where its velocity or acceleration is meant."""


def load_name(array: str, index: int, equations: Terms) -> str:
    """What a reader calls an input: the coordinate, its velocity with a d in front, or the parameter."""
    if array == "q" or array in MARKS:
        return MARKS.get(array, "") + equations.free[index].name
    if array == "p" and index < len(equations.parameters):
        return equations.parameters[index].name
    return "t" if array == "t" else f"{array}{index}"


def reference_name(bound: BoundTerm, reference: Reference) -> str:
    """What a reader calls what a reference of a term stands for."""
    kind, k = reference
    if kind == "lam":
        return "multiplier"
    return MARKS[kind] + bound.names[Reference("q", k)] if kind in MARKS else bound.names[reference]


def term_comment(bound: BoundTerm, equations: Terms) -> str:
    term = bound.term
    if term.row is None:
        return term.label
    row = equations.model.rows[term.row]
    code = f"{row.code} " if row.code else ""
    return f"row {term.row + 1}: {code}{row.label} ({row.owner}): {term.equation}"
