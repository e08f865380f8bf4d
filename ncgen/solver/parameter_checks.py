"""Whether parameters are values that the model could have been made with: what is no mass as a number is rejected in p.

Everything that takes p from a caller judges it here, through `ncgen.solver.argument_checks` or `ncgen.solver.motions.states`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import Model, bodies, rows
from ncgen.model.value_conditions import Condition
from ncgen.model.values import mentioned
from ncgen.program.initial import assemble_values
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.evaluate import evaluate_rows

if TYPE_CHECKING:
    from ncgen.solver.argument_checks import Outline

Judged: TypeAlias = tuple[list[Condition], Program]
"""The conditions of a model that parameters have a say in, and a program of the numbers that they are about."""


ACCEPTED = 16
"""Parameters that are remembered as accepted: one call hands the same ones from function to function."""


def check_parameters(kernels: Outline, p: np.ndarray) -> None:
    """Raise ModelError where parameters p (n_p,) are values that the model could not have been made with, naming them and their numbers."""

    def accept() -> None:
        if refused := refused_parameters(kernels, p[None]):
            raise ModelError(f"p: {refused[0]}")

    remember = getattr(kernels, "remember", None)
    if remember:
        remember("accepted p", p.tobytes(), accept, ACCEPTED)
    else:
        accept()


def refused_parameters(kernels: Outline, p: np.ndarray) -> dict[int, str]:
    """{row of p (B, n_p): why the model could not have been made with it}; rows with a number that is not finite are left to others."""
    conditions, program = _judged(kernels)
    if not conditions:
        return {}
    with np.errstate(all="ignore"):
        numbers = evaluate_rows(program, np.asarray(p, dtype=float))
    finite, refused, first = np.isfinite(p).all(axis=-1), {}, 0
    for condition in conditions:
        tested = numbers[..., first : first + len(condition.values)]
        first += len(condition.values)
        for row in np.flatnonzero(finite & ~condition.holds(tested)).tolist():
            names = mentioned(condition.values, kernels.model.parameters).split(", ")
            values = ", ".join(f"{name} = {p[row, kernels.parameters.index(name)]:g}" for name in names)
            refused.setdefault(row, f"with {values}, {condition.sentence(tested[row])}")
    return refused


def _judged(kernels: Outline) -> Judged:
    """Found once for kernels; a model that is not compiled may still change."""
    remember = getattr(kernels, "remember", None)
    return remember("conditions of p", (), lambda: _compiled_conditions(kernels.model)) if remember else _compiled_conditions(kernels.model)


def _compiled_conditions(model: Model) -> Judged:
    conditions = [condition for condition in _conditions(model) if condition.is_parametric]
    return conditions, assemble_values(model, [value for condition in conditions for value in condition.values])


def _conditions(model: Model) -> Iterator[Condition]:
    for body in model.bodies.values():
        if body.inertia is not None and body.inertia.is_judged:
            for inertia in body.inertia.parts or (body.inertia,):
                yield from bodies.conditions(inertia.name or body.name, inertia.mass, inertia.tensor)
    for row in model.rows:
        yield from rows.conditions(row)
    yield from model.conditions


def judged_parameters(kernels: Outline) -> set[str]:
    """Names of the parameters that have a say in the conditions of a model."""
    conditions, _ = _judged(kernels)
    return {name for condition in conditions for name in mentioned(condition.values, kernels.model.parameters).split(", ")}
