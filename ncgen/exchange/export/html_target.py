"""One page that computes: the exported motion in WebAssembly, drawn, driven and plotted where it is opened, with nothing fetched."""

from __future__ import annotations

import base64
import zlib

from ncgen.emit.environment import render
from ncgen.exchange.export.package import Package
from ncgen.exchange.export.wasm_target import assembled
from ncgen.model import Model
from ncgen.model.elements import Combination, Component, Element, Point, Spatial, Vector
from ncgen.model.rows import Row
from ncgen.program.initial import assemble_described
from ncgen.program.ir.blocks import Pattern
from ncgen.view.chosen import MOST, telling
from ncgen.view.page import drawing, lean, rounded, script_json, script_text
from ncgen.view.scene import Scene, scene_of

USED = ("phi", "phi_q", "nu", "mass", "energy")
"""The kernels that the page calls, as far as the mechanism has them."""


def files(package: Package) -> dict[str, str]:
    """{file name: text}: the page alone."""
    model, scene = package.kernels.model, scene_of(package.kernels.model)
    drawn = _drawn(model, scene)
    fixed = [c for element in drawn for c in element.components if c.fixed]
    equations, programs = package.sources.programs.equations, package.sources.programs.programs
    kernels = [*(programs[name] for name in USED if name in programs), assemble_described(equations, [*equations.free, *fixed])]
    binary, records = assembled(package, kernels, "Mechanism")
    data = _scene(scene, drawn) | _mechanism(package) | {"places": _places(package, drawn, fixed), "kernels": [k.name for k in kernels]}
    page = render(
        "package/html/page.html.jinja",
        name=model.name,
        wrapper=script_text(lean(render("package/wasm/wrapper.js.jinja", **records))),
        script=script_text(lean(render("package/html/script.js.jinja"))),
        binary=base64.b64encode(zlib.compress(binary, 9)).decode(),
        data=script_json(data),
    )
    return {f"{package.prefix}.html": page}


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
    place = {component: package.kernels.n + k for k, component in enumerate(fixed)}
    place |= package.sources.programs.equations.index
    return [[place[component] for component in element.components] for element in drawn]


def _mechanism(package: Package) -> dict:
    """What the page is told of the mechanism beside its picture and its kernels."""
    kernels, model = package.kernels, package.kernels.model
    return {
        "units": [package.unit(name) for name in kernels.coordinates],
        "independent": list(package.independent),
        "shown": telling(model, kernels.coordinates, package.independent)[:MOST],  # at first
        "duration": package.duration,
        "parameters": [{"unit": number.unit, "input": name in model.inputs} for name, number in model.numbers.items()],
        "outputs": [{"label": output.label, "unit": output.unit} for output in model.outputs.values()],
        "rows": [_row(model, row) for row in kernels.rows],
        "rowSizes": kernels.row_sizes.tolist(),
        "phiQ": _pattern(kernels.phi_q_pattern),
        "mass": _pattern(kernels.mass_pattern),
        "massSizes": rounded(package.sizes.W),
        "lengths": rounded(kernels.column_sizes),
    }


def _pattern(pattern: Pattern) -> dict:
    return {"indptr": pattern.indptr, "indices": pattern.indices}


def _row(model: Model, row: Row) -> dict:
    """A row in the user's words, the elements that it speaks of, and the bodies that it belongs to."""
    elements = _elements(model, row)
    bodies = list(model.bodies.values())
    owners = [i for i, body in enumerate(bodies) if row.owner.kind == "body" and row.owner.name == body.name]
    sharing = [i for i, body in enumerate(bodies) if any(element in body.elements for element in elements)]
    return {
        "label": row.label,
        "owner": str(row.owner),
        "text": row.equation,
        "elements": [element.name for element in elements],
        "bodies": [bodies[i].name for i in owners],
        "touched": [bodies[i].name for i in sharing],
    }


def _elements(model: Model, row: Row) -> list[Element]:
    """The elements that a row is written in."""
    if row.type is None:
        mentioned = {symbol.name for symbol in getattr(row.written, "free_symbols", ())}
        return [e for e in model.elements.values() if any(c.name in mentioned or c.rate.name in mentioned for c in e.components)]
    elements = [e for a in row.arguments.values() for e in (a.elements if isinstance(a, Combination) else _owners(model, a))]
    return list(dict.fromkeys(elements))


def _owners(model: Model, component: Component) -> list[Element]:
    return [element for element in model.elements.values() if component in element.components]
