"""The types of terms of which a mechanism is a list of numbers, as the generic kernels of ncgen/runtime/generic read it.

    n, m, terms, rows      coordinates, constraint equations, terms, and how many of the first terms belong to these equations
    every term             type, its constraint equation or -1; per scalar of the type a constant, the number of pairs, pairs
                           (weight, coordinate); then the constants of the type

Several terms may belong to one constraint equation, which is their sum.
"""

from __future__ import annotations

from functools import cache

from ncgen.model.catalogue import ROW_TYPES
from ncgen.model.forces import FORCE_TYPES
from ncgen.symbolic import force_templates, mass_templates, templates
from ncgen.symbolic.templates import SCALE, Template


@cache
def drive() -> Template:
    """A scalar that moves as a constant, a constant speed and an oscillation say: x - (c0 + c1 t + A sin(w t + h))."""
    import sympy

    x, c0, c1, A, w, h, scale = templates.symbols(["x", "c0", "c1", "A", "w", "h", SCALE])
    law = c0 + c1 * templates.time() + A * sympy.sin(w * templates.time() + h)
    return templates.expression_row_template("drive", scale * (x - law), ("x",), ("c0", "c1", "A", "w", "h", SCALE))


@cache
def push() -> Template:
    """A constant force along a scalar, whose work is counted."""
    (f,) = templates.symbols(["f"])
    return force_templates.user_force("push", ("x",), ("f",), {0: f})


@cache
def types() -> tuple[Template, ...]:
    """The types of terms, in the order of their numbers."""
    rows = tuple(map(templates.row_template, ROW_TYPES))
    masses = (mass_templates.mass_diagonal(), mass_templates.mass_pair(), mass_templates.cross_product_body())
    weights = (mass_templates.weight(), mass_templates.energy_offset())
    return (*rows, drive(), *masses, *weights, *map(force_templates.force_template, FORCE_TYPES), push())
