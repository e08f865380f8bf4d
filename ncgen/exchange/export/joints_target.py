"""A mechanism over its joints in C: kinematics, mass matrix, inverse and forward dynamics and their derivatives, for a controller."""

from __future__ import annotations

from collections.abc import Mapping

from ncgen import __version__
from ncgen.compiler import compile
from ncgen.emit.c.c_spelling import number
from ncgen.emit.c.files import program_records
from ncgen.emit.naming import labels, prefix_of
from ncgen.exchange.export.package import without_runtime
from ncgen.exchange.robots.frame_outputs import carried
from ncgen.model import Model
from ncgen.model.bodies import BodyFrame
from ncgen.model.elements import Point
from ncgen.program.ir.blocks import Program
from ncgen.program.ir.verify import verify
from ncgen.program.lines import Lines
from ncgen.program.tree.joint_programs import POSITION, Made
from ncgen.program.tree.tree_motion import TreeGeometry
from ncgen.solver.joints.joint_loops import JointsInLoops
from ncgen.solver.joints.joint_space import JointSpace, joint_space

DESCRIPTIONS = {
    "joint_position": "q for values x of the joints",
    "joint_screws": "for every joint of the tree its axis, and its velocity at the origin",
    "joint_spread": "rates of all joints for rate 1 of every independent one, row by row, and for none",
    "joint_mass": "the mass matrix, its lower triangle row by row",
    "joint_inverse": "forces for rates v and accelerations a",
    "joint_loads": "forces of springs, dampers and whatever else the model has",
    "joint_frames": "of every frame its position, and its rotation row by row",
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
    frames = {name: frame for name, frame in model.frames.items() if frame.is_output}
    programs = [program for group in PARTS for program in space.made(group).values()]
    records = {
        **program_records([*programs, *([_poses(space, frames)] if frames else [])], prefix, "joints"),
        "version": __version__,
        "model": model,
        "joints": [{"name": joint.text, "label": joint.label} for joint in labels(space.rates)],
        "points": _points(space),
        "frames": _frames(space, frames),
        "tree_rates": space.tree.dof,
        **_loops(space),
        "coordinates": kernels.n,
        "defaults": [number(float(value)) for value in kernels.p0],
        "start": [repr(float(value)) for value in space.values(kernels.q0)],
        "descriptions": DESCRIPTIONS,
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


def _poses(space: JointSpace, frames: Mapping[str, BodyFrame]) -> Program:
    """joint_frames(t, q, p) -> of every frame its position, and its rotation row by row: 12 numbers."""
    model, equations = space.kernels.model, space.kernels.programs.equations
    lines = Lines(equations)
    tree, outputs = TreeGeometry(lines, space.tree), list[int]()
    for frame in frames.values():
        if frame.body == model.ground.name:
            numbers = [*frame.position, *frame.rotation.ravel()]
            outputs += [lines.graph.const(float(number)) for number in numbers]
            continue
        origin, axes = carried(model, frame)
        columns = [tree.combined(axis) for axis in axes]
        outputs += [*tree.combined(origin), *(columns[j][i] for i in range(3) for j in range(3))]
    program = lines.program("joint_frames", POSITION, outputs)
    verify(program, {"t": 1, "q": space.kernels.n, "p": len(equations.parameters)})
    return program


def _frames(space: JointSpace, frames: Mapping[str, BodyFrame]) -> list[dict[str, object]]:
    """Frames that are asked for, and which rates of the tree move them."""
    homes = {link.body.name: space.tree.paths[number] for number, link in enumerate(space.tree.links)}
    rates = range(space.tree.dof)
    return [
        {"name": name.text, "label": name.label, "moves": [int(k in homes.get(frame.body, ())) for k in rates]}
        for name, frame in zip(labels(list(frames)), frames.values(), strict=True)
    ]


def _points(space: JointSpace) -> list[dict[str, object]]:
    """Points that move in all directions with a body, where their first coordinate stands, and which rates of the tree move them."""
    kernels, paths = space.kernels, space.tree.paths
    elements = kernels.model.elements.values()
    points = [e for e in elements if isinstance(e, Point) and not any(c.fixed for c in e.components) and e in space.tree.home]
    names = labels([e.name for e in points])
    return [
        {
            "name": e.name,
            "label": c.label,
            "place": kernels.index[e.x.name],
            "moves": [int(k in paths[space.tree.home[e]]) for k in range(space.tree.dof)],
        }
        for e, c in zip(points, names, strict=True)
    ]
