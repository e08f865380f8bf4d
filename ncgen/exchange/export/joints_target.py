"""A mechanism over its joints in C: kinematics, mass matrix, inverse and forward dynamics, for a controller."""

from __future__ import annotations

from ncgen import __version__
from ncgen.compiler import compile
from ncgen.emit.c.files import program_records
from ncgen.emit.c.spelling import number
from ncgen.emit.environment import render
from ncgen.emit.naming import identifier, labels
from ncgen.emit.runtime import HEADERS, runtime_files
from ncgen.exchange.export.package import renamed
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.model.elements import Point
from ncgen.program.joint_space import assemble_joint_space
from ncgen.solver.joint_space import joint_space

TOLD = {
    "joint_position": "q for values x of the joints",
    "joint_screws": "for every joint its axis, and its velocity at the origin",
    "joint_mass": "the mass matrix, its lower triangle row by row",
    "joint_inverse": "forces for rates v and accelerations a",
    "joint_loads": "forces of springs, dampers and whatever else the model has",
}

NEEDED = ("ncgen.h", "ncgen_math.h")
"""Headers that the sources include."""


def files_of(model: Model) -> dict[str, str]:
    """{path in the folder: text}. Raises ModelError where the mechanism is no open tree of joints."""
    kernels = compile(model, backend="numpy")
    space = joint_space(kernels)
    prefix = identifier(kernels.name)
    programs = assemble_joint_space(kernels.programs.equations, space.followed)
    records = {
        **program_records(programs.values(), prefix, "joints"),
        "version": __version__,
        "model": model,
        "joints": [{"name": joint.text, "label": joint.label} for joint in labels(space.rates)],
        "points": _points(kernels),
        "coordinates": kernels.n,
        "defaults": [number(float(value)) for value in kernels.p0],
        "start": [repr(float(value)) for value in space.values(kernels.q0)],
        "told": TOLD,
    }

    def filled(template: str) -> str:
        return renamed(render(f"package/joints/{template}.jinja", **records), prefix)

    headers = {renamed(name, prefix): renamed(text, prefix) for name, text in runtime_files(*HEADERS).items() if name in NEEDED}
    own = {f"{prefix}_joints.{end}": filled(f"joints.{end}") for end in "hc"}
    return {**{name: filled(name) for name in ("README.md", "Makefile", "main.c")}, **own, **headers}


def _points(kernels: Kernels) -> list[dict[str, object]]:
    """Points that move in all directions, and where their first coordinate stands."""
    points = [e for e in kernels.model.elements.values() if isinstance(e, Point) and not any(c.fixed for c in e.components)]
    places = labels([e.name for e in points])
    return [{"name": e.name, "label": c.label, "place": kernels.index[e.x.name]} for e, c in zip(points, places, strict=True)]
