"""The templates of the catalogue as operations, read from catalogued.json: sympy derives them once, and not at every first start.

`python -m ncgen.program.ir.catalogued` writes the file anew, where the catalogue or what derives from it has changed; a test compares.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import TypeAlias

from ncgen.files import write_text
from ncgen.model.catalogue import ROW_TYPES
from ncgen.model.forces import FORCE_TYPES
from ncgen.model.polynomial_forces import POLYNOMIAL_FORCE_TYPES
from ncgen.program.ir.graph import Op
from ncgen.symbolic.force_templates import force_template
from ncgen.symbolic.mass_templates import cross_product_body, energy_offset, mass_diagonal, mass_pair, weight
from ncgen.symbolic.templates import Template, TemplateOutput, row_template

FILE = Path(__file__).with_name("catalogued.json")

Operations: TypeAlias = tuple[tuple[Op, ...], dict[TemplateOutput, int]]
"""Operations, and the node of every output."""


@cache
def catalogued() -> dict[str, Operations]:
    """{key of a template: its operations}."""
    operations: dict[str, Operations] = {}
    for key, (ops, outputs) in json.loads(FILE.read_text(encoding="utf-8")).items():
        nodes = {TemplateOutput(name, tuple(scalars)): node for name, scalars, node in outputs}
        operations[key] = tuple([Op(code, tuple(args), leaf) for code, args, leaf in ops]), nodes
    return operations


def catalogue() -> tuple[Template, ...]:
    """The templates that are the same in all mechanisms and that sympy derives."""
    masses = mass_diagonal(), mass_pair(), weight(), energy_offset(), cross_product_body()
    return (*map(row_template, ROW_TYPES), *masses, *map(force_template, (*FORCE_TYPES, *POLYNOMIAL_FORCE_TYPES)))


def derived() -> str:
    """What the file is to hold: a line a template, derived by sympy."""
    from ncgen.program.ir.lower import LoweredTemplate

    lines: list[str] = []
    for template in catalogue():
        made = LoweredTemplate(template)
        outputs = [[*output, node] for output, node in made.outputs.items()]
        lines.append(f"{json.dumps(template.key)}: {json.dumps([made.ops, outputs], separators=(',', ':'))}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


if __name__ == "__main__":
    write_text(FILE, derived())
