"""One page that computes: the exported motion in WebAssembly, drawn, driven and plotted where it is opened, with nothing fetched."""

from __future__ import annotations

import base64
import re
import zlib

from ncgen.emit.environment import render
from ncgen.errors import counted, unknown_word
from ncgen.exchange.export.package import Package, package
from ncgen.exchange.export.wasm_target import assembled
from ncgen.exchange.turnable import turnable
from ncgen.model import Model
from ncgen.model.elements import Combination, Component, Element, Point, Spatial, Vector
from ncgen.model.rows import Row
from ncgen.model.values import Parameter
from ncgen.program.initial import assemble_described
from ncgen.program.ir.blocks import Pattern
from ncgen.program.motions.full_loads import assemble_loads, loaded_elements
from ncgen.solver.positions.rank import freedom
from ncgen.symbolic.numbering import Terms
from ncgen.view.chosen import MAX_COORDINATES, informative
from ncgen.view.page import drawing, lean, rounded, script_json
from ncgen.view.scene import Scene, scene_of

USED = ("phi", "phi_q", "nu", "gamma", "mass", "force", "energy")
"""The kernels that the page calls, as far as the mechanism has them."""

GROUPS = {"position": "places", "mass": "masses", "inertia": "masses"}
"""{argument of a fact: group of sliders} of numbers that the model has no parameter for."""


def files_of(model: Model) -> dict[str, str]:
    """{file name: text}: the page alone, in which the model's own parameters come first and its other numbers can be turned, too."""
    return _files(package(turnable(model), events=True), named=tuple(model.numbers))


def _files(package: Package, named: tuple[str, ...]) -> dict[str, str]:
    model, scene = package.kernels.model, scene_of(package.kernels.model)
    drawn = _drawn(model, scene)
    fixed = [c for element in drawn for c in element.components if c.fixed]
    equations, programs = package.sources.programs.equations, package.sources.programs.programs
    kernels = [*(programs[name] for name in USED if name in programs), assemble_described(equations, [*equations.free, *fixed])]
    kernels += assemble_loads(equations)[:1]
    made, records = assembled(package, kernels, "Mechanism")
    data = _scene(scene, drawn) | _mechanism(package) | {"places": _places(package, drawn, fixed), "kernels": [k.name for k in kernels]}
    data["rows"] = [_row(model, row, named) for row in package.kernels.rows]
    _check_ranges(model)
    kept = package.events.own if package.events else ()
    data |= {"parameters": [_parameter(model, name, named) | ({"group": ""} if name in kept else {}) for name in model.numbers]}
    data |= {"movable": _movable(model), "loads": _loads(equations, scene)}
    script = render("package/html/script.js.jinja", wrapper=render("package/wasm/wrapper.js.jinja", **records))
    page = render(
        "package/html/page.html.jinja",
        name=model.name,
        planar=data["planar"],
        freedom=_freedom(package),
        driven=next(iter(package.independent), ""),
        script=_packed(lean(script).encode()),
        binary=_packed(made.binary),
        data=script_json(data),
    )
    return {f"{package.prefix}.html": page}


def _packed(data: bytes) -> str:
    """Bytes, compressed and written in 85 letters, five for four bytes; v stands for <, which would be markup."""
    return base64.a85encode(zlib.compress(data, 9)).decode().replace("<", "v")


def _drawn(model: Model, scene: Scene) -> list[Spatial]:
    """The points and vectors of the picture, in its order."""
    points = [element for element in model.elements.values() if isinstance(element, Point)]
    vectors = {name: e for name, e in model.elements.items() if isinstance(e, Vector)}
    return [*points, *(vectors[name] for name in scene.moving)]


def _scene(scene: Scene, drawn: list[Spatial]) -> dict:
    """What is drawn. Only what can never leave its plane is planar."""
    flat = all(e.z.fixed for e in drawn if isinstance(e, Point))
    return drawing(scene) | {"planar": scene.planar and flat}


def _places(package: Package, drawn: list[Spatial], fixed: list[Component]) -> list[list[int]]:
    """Where the components of what is drawn stand: in q, or from n on among the fixed ones."""
    index = {component: package.kernels.n + k for k, component in enumerate(fixed)}
    index |= package.sources.programs.equations.index
    return [[index[component] for component in element.components] for element in drawn]


def _mechanism(package: Package) -> dict:
    """What the page gets of the mechanism in addition to its picture and its kernels."""
    kernels, model = package.kernels, package.kernels.model
    return {
        "events": package.events.names if package.events else [],
        "units": [package.unit(name) for name in kernels.coordinates],
        "shown": informative(model, kernels.coordinates, package.independent)[:MAX_COORDINATES],  # at first
        "duration": package.duration,
        "outputs": [{"label": output.label, "unit": output.unit} for output in model.outputs.values()],
        "rowSizes": kernels.row_sizes.tolist(),
        "phiQ": _pattern(kernels.phi_q_pattern),
        "lengths": rounded(kernels.column_sizes),
    }


def _freedom(package: Package) -> str:
    """The numbers of equations, coordinates and degrees of freedom, and what is redundant by name."""
    kernels, mobility = package.kernels, freedom(package.kernels, package.q)
    text = f"{counted(kernels.m, 'equation')}, {counted(kernels.n, 'coordinate')}: {counted(mobility.dof, 'degree')} of freedom"
    names = [kernels.rows[redundancy.row].label for redundancy in mobility.redundant]
    if not names:
        return f"{text}, nothing redundant."
    return f"{text}. Others imply {', '.join(names)}: how joint forces are shared is not determined."


def _parameter(model: Model, name: str, named: tuple[str, ...]) -> dict:
    """Unit of a parameter, the group of sliders that it belongs to, and the ends of its slider where the model says them."""
    ends = model.drawing.ranges.get(name)
    if name in named or ends:
        group = "inputs" if name in model.inputs else "parameters"
    else:
        group = GROUPS.get(next((word for word in name.split(".") if word in GROUPS), ""), "others")
    return {"unit": model.numbers[name].unit, "group": group} | ({"range": ends} if ends else {})


def _check_ranges(model: Model) -> None:
    """Refuse a range of what the page has no slider for."""
    for name in model.drawing.ranges:
        if name not in model.numbers:
            raise unknown_word(name, f"{model.name}: range", model.numbers)


def _loads(equations: Terms, scene: Scene) -> list[dict]:
    """The forces on bodies at their points: where their three numbers begin among all loads."""
    loads = enumerate(loaded_elements(equations))
    return [
        {"body": body.name, "point": scene.points.index(element.name), "place": 3 * k}
        for k, (body, element) in loads
        if isinstance(element, Point)
    ]


def _movable(model: Model) -> list[list[int]]:
    """For every point the places in p of the parameters that its coordinates are, −1 for any other."""
    names = list(model.numbers)
    points = [element for element in model.elements.values() if isinstance(element, Point)]
    return [[names.index(c.value.name) if isinstance(c.value, Parameter) else -1 for c in point.components] for point in points]


def _pattern(pattern: Pattern) -> dict:
    return {"indptr": pattern.indptr, "indices": pattern.indices}


def _row(model: Model, row: Row, named: tuple[str, ...]) -> dict:
    """A row in the user's words, the elements that it speaks of, and the bodies that it belongs to.

    named: the model's own parameters; constants that follow from other ones are left out
    """
    elements = _elements(model, row)
    bodies = list(model.bodies.values())
    owners = [i for i, body in enumerate(bodies) if row.owner.kind == "body" and row.owner.name == body.name]
    sharing = [i for i, body in enumerate(bodies) if any(element in body.elements for element in elements)]
    return {
        "label": row.label,
        "owner": str(row.owner),
        "text": _without(row.equation, [name for name in model.numbers if name not in named]),
        "elements": [element.name for element in elements],
        "bodies": [bodies[i].name for i in owners],
        "touched": [bodies[i].name for i in sharing],
    }


def _without(equation: str, names: list[str]) -> str:
    """A row's text without those of its constants, ", L = ...", that are written in some parameters."""
    parts = re.split(r", (?=\w+ = )", equation)
    return ", ".join(constant for constant in parts if not any(name in constant for name in names))


def _elements(model: Model, row: Row) -> list[Element]:
    """The elements that a row is written in."""
    if row.type is None:
        mentioned = {symbol.name for symbol in getattr(row.written, "free_symbols", ())}
        return [e for e in model.elements.values() if any(c.name in mentioned or c.rate.name in mentioned for c in e.components)]
    elements = [e for a in row.arguments.values() for e in (a.elements if isinstance(a, Combination) else _owners(model, a))]
    return list(dict.fromkeys(elements))


def _owners(model: Model, component: Component) -> list[Element]:
    return [element for element in model.elements.values() if component in element.components]
