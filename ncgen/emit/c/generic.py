"""The types of terms as functions in C, for the generic kernels of ncgen/runtime/generic."""

from __future__ import annotations

from ncgen.emit.c.files import program_records
from ncgen.emit.environment import render
from ncgen.emit.naming import identifier
from ncgen.emit.runtime_files import runtime_files
from ncgen.model.elements import rate_name
from ncgen.model.names import TIME
from ncgen.program.ir.angles import share_angles
from ncgen.program.ir.blocks import Program, Store, Straight
from ncgen.program.ir.finishing import finish
from ncgen.program.ir.graph import Graph
from ncgen.program.ir.lower import lowered
from ncgen.program.term_tables import types
from ncgen.symbolic.templates import Template, TemplateOutput

SINGLE = ("phi", "nu", "gamma", "kinetic", "potential", "power")
"""What a type's function writes first; one number for each of its scalars follows, Φ_q or a force, then the mass between all pairs."""

SOURCES = ("ncgen_generic.h", "ncgen_generic.c")
PREFIX = "ncgen_type"


def generic_files() -> dict[str, str]:
    """{file name: text}: the kernels that read a mechanism from a table, and the types of terms that they know."""
    return {**runtime_files(*SOURCES, "ncgen.h", "ncgen_math.h"), "ncgen_types.c": types_source()}


def types_source() -> str:
    """The types of terms as one source in C."""
    programs = [type_program(template) for template in types()]
    described = [
        {
            "function": f"{PREFIX}_{program.name}",
            "key": template.key,
            "scalars": len(template.scalars),
            "data": len(template.data),
            "has_mass": int(has_mass(template)),
        }
        for template, program in zip(types(), programs, strict=True)
    ]
    return render("c/ncgen_types.c.jinja", types=described, **program_records(programs, PREFIX))


def has_mass(template: Template) -> bool:
    """Whether terms of a type carry inertia."""
    return any(output.name == "mass" for output in lowered(template).outputs)


def type_program(template: Template) -> Program:
    """All outputs of a type: q are its scalars, q̇ their rates, p its constants."""
    graph, count = Graph(), len(template.scalars)
    names = {name: ("q", k) for k, name in enumerate(template.scalars)}
    names |= {rate_name(name): ("qd", k) for k, name in enumerate(template.scalars)}
    names |= {name: ("p", k) for k, name in enumerate(template.data)} | {TIME: ("t", 0)}
    operations = lowered(template)
    made = operations.replay(graph, lambda name: graph.load(*names[name]), operations.outputs)
    gradient = [TemplateOutput(name, (k,)) for k in range(count) for name in ("phi_q", "force")]
    along = [next((o for o in gradient[2 * k : 2 * k + 2] if o in made), gradient[2 * k]) for k in range(count)]
    wanted = [*map(TemplateOutput, SINGLE), *along]
    if has_mass(template):
        wanted += [TemplateOutput("mass", (k, l)) for k in range(count) for l in range(count)]
    nodes = [made.get(output, graph.const(0.0)) for output in wanted]
    words = {graph.load(*element): name for name, element in names.items()}
    stores = tuple(Store(array="out", index=k, node=node) for k, node in enumerate(nodes))
    block = finish(Straight(tuple(graph.ops), stores, words, f"{template.key}: {template.equation}"))
    return share_angles(
        Program(
            name=identifier(template.key.replace("-", "_")), inputs=("t", "q", "qd", "p"), output="out", size=len(nodes), blocks=(block,)
        )
    )
