"""A mechanism over its joints in C: kinematics, mass matrix, inverse and forward dynamics and their derivatives, for a controller."""

from __future__ import annotations

from ncgen import __version__
from ncgen.compiler import compile
from ncgen.emit.c.files import program_records
from ncgen.emit.c.spelling import number
from ncgen.emit.naming import labels, prefix_of
from ncgen.exchange.export.package import without_runtime
from ncgen.model import Model
from ncgen.model.elements import Point
from ncgen.program.tree.joint_space import Made
from ncgen.solver.joints.joint_loops import JointsInLoops
from ncgen.solver.joints.joint_space import JointSpace, joint_space

TOLD = {
    "joint_position": "q for values x of the joints",
    "joint_screws": "for every joint of the tree its axis, and its velocity at the origin",
    "joint_spread": "rates of all joints for rate 1 of every independent one, row by row, and for none",
    "joint_mass": "the mass matrix, its lower triangle row by row",
    "joint_inverse": "forces for rates v and accelerations a",
    "joint_loads": "forces of springs, dampers and whatever else the model has",
    "joint_momenta": "mass, first moment about the origin, and for every joint of the tree linear and angular momentum about it",
    "joint_inverse_tangent": "how forces change where joints move by dx and rates by dv",
    "joint_loads_tangent": "the same of the model's forces",
}

PARTS: tuple[Made, ...] = ("basics", "slopes")


def files_of(model: Model) -> dict[str, str]:
    """{path in the folder: text}. Raises ModelError where the mechanism has no joint space."""
    kernels = compile(model, backend="numpy")
    space = joint_space(kernels)
    prefix = prefix_of(kernels.name)
    records = {
        **program_records((program for what in PARTS for program in space.made(what).values()), prefix, "joints"),
        "version": __version__,
        "model": model,
        "joints": [{"name": joint.text, "label": joint.label} for joint in labels(space.rates)],
        "points": _points(space),
        "tree_rates": space.tree.freedoms,
        **_loops(space),
        "coordinates": kernels.n,
        "defaults": [number(float(value)) for value in kernels.p0],
        "start": [repr(float(value)) for value in space.values(kernels.q0)],
        "told": TOLD,
    }

    return without_runtime("joints", "joints", prefix, records, ("README.md", "Makefile", "main.c"))


def _loops(space: JointSpace) -> dict[str, object]:
    """What closing needs to know; nothing of an open tree."""
    if not isinstance(space, JointsInLoops):
        return {"loops": False}
    return {
        "loops": True,
        "free": space.free.tolist(),
        "sizes": [number(float(size)) for size in space.sizes],
        "all_start": [number(float(x)) for x in space.begin[0]],
    }


def _points(space: JointSpace) -> list[dict[str, object]]:
    """Points that move in all directions with a body, where their first coordinate stands, and which rates of the tree move them."""
    kernels, paths = space.kernels, space.tree.paths
    elements = kernels.model.elements.values()
    points = [e for e in elements if isinstance(e, Point) and not any(c.fixed for c in e.components) and e in space.tree.home]
    places = labels([e.name for e in points])
    return [
        {
            "name": e.name,
            "label": c.label,
            "place": kernels.index[e.x.name],
            "moves": [int(k in paths[space.tree.home[e]]) for k in range(space.tree.freedoms)],
        }
        for e, c in zip(points, places, strict=True)
    ]
