"""Featherstone's articulated-body algorithm for arms, in joint angles and body axes, as other generators emit it: written with CasADi's
expressions, its C code compiled like the generated one.

Every body has the axes of its hinge, so that a joint is a constant rotation and one about z.
Source: Featherstone, Rigid Body Dynamics Algorithms (2008), table 7.1. Any: an expression or a function of CasADi.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.rivals.casadi import code
from ncgen.comparisons.rivals.base import foreign
from ncgen.emit.runtime_files import runtime_files
from ncgen.mechanism.kernels import Kernels
from ncgen.model.values import evaluate
from ncgen.program.programs import Split
from ncgen.program.tree.closed_positions import Hinge, hinges_of
from ncgen.program.tree.rates import NoRecursion
from ncgen.report.repeat import KernelCall
from ncgen.symbolic.tree import TreeLink, spanning_tree

WRAPPER = """
int articulated_gamma(double t, const double *q, const double *qd, const double *p, double *out)
{{
    static const int place[] = {{ {places} }};
    double angle[{n}];
    const double *in[] = {{ angle, qd }};
    double *res[] = {{ out }};
    double work[{work}];
    long long whole[{whole}];
    (void)t, (void)p;
    for (int i = 0; i < {n}; ++i)
        angle[i] = q[place[i]];
    return articulated(in, res, whole, work, 0);
}}
"""


@dataclass(frozen=True, eq=False)
class Joint:
    """rotation: of the body's axes in those of its parent at angle 0; offset: of its hinge there (m); mass, centre and inertia about the
    centre in the body's axes (kg, m, kg m²); rate: the number of its independent coordinate; sign: of the turn with the angle"""

    parent: int | None
    rotation: np.ndarray
    offset: np.ndarray
    mass: float
    centre: np.ndarray
    inertia: np.ndarray
    rate: int
    sign: float


def rival(kernels: Kernels, split: Split) -> tuple[KernelCall, int, float] | None:
    """The accelerations of the independent angles as a function (t, q, żd, p), its operations, and the seconds until it could be called;
    None where CasADi is not installed or the mechanism is no open tree of hinges that falls freely."""
    try:
        casadi = import_module("casadi")
        found = joints(kernels, split)
    except (ImportError, NoRecursion):
        return None
    size, start = len(found), time.perf_counter()
    function = _function(casadi, found, [evaluate(g, kernels.model.parameters, "gravity") for g in kernels.model.gravity_field])
    text = code(casadi, {"articulated": function}) + WRAPPER.format(
        places=", ".join(map(str, split.independent)), n=size, work=max(function.sz_w(), 1), whole=max(function.sz_iw(), 1)
    )
    calls, built = foreign({"articulated.c": text} | runtime_files("ncgen.h"), {"gamma": size}, "articulated_{}")
    ready = time.perf_counter() - start - built.seconds + built.spent
    return calls["gamma"], function.n_instructions() - function.nnz_in() - function.nnz_out(), ready


def joints(kernels: Kernels, split: Split) -> list[Joint]:
    """The tree as joints, from the initial position."""
    model = kernels.model
    if model.springs or model.potentials or kernels.model.callbacks or np.any(kernels.nu(kernels.q0)):
        raise NoRecursion("something pulls besides gravity")
    tree = spanning_tree(model)
    by_link = hinges_of(kernels.programs.equations, tree, split)
    if not len(by_link) == len(tree.links) == len(split.independent):
        raise NoRecursion("not every link is on a hinge with an independent angle")
    hinges = [by_link[number] for number in range(len(tree.links))]
    frames = [_frame(hinge, link) for hinge, link in zip(hinges, tree.links, strict=True)]
    found = []
    for number, (link, hinge) in enumerate(zip(tree.links, hinges, strict=True)):
        axes, origin = frames[number]
        before, start = frames[link.parent] if link.parent is not None else (np.eye(3), np.zeros(3))
        rate = [kernels.coordinates[c] for c in split.independent].index(hinge.angle.name)
        turn = hinge.sign * float(hinge.angle.initial[0])
        own = link.body.own_inertia
        back = np.array([[np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
        mass, *numbers = (evaluate(x, model.parameters, link.body.name) for x in (own.mass, *own.com, *own.tensor.flat))
        centre = axes.T @ (np.array(numbers[:3]) - origin)
        inertia = axes.T @ np.array(numbers[3:]).reshape(3, 3) @ axes
        rotation, offset = before.T @ axes @ back, before.T @ (origin - start)
        found.append(Joint(link.parent, rotation, offset, mass, centre, inertia, rate, hinge.sign))
    return found


def _frame(hinge: Hinge, link: TreeLink) -> tuple[np.ndarray, np.ndarray]:
    """Axes (columns, z along the hinge) and origin of a link in the initial position."""
    along, start = (direction.initial / np.linalg.norm(direction.initial) for direction in (hinge.angle.axis, hinge.start))
    start = start - (start @ along) * along  # an angle about an axis is that of projections
    start = start / np.linalg.norm(start)
    point = link.screws[0].point
    assert point is not None, "a hinge turns about a point"
    return np.array([start, np.cross(along, start), along]).T, point.initial


def _function(ca: ModuleType, found: list[Joint], gravity: list[float]) -> Any:
    """(angles, rates) -> accelerations of the angles; spatial vectors are (velocity, angular velocity)."""
    n = len(found)
    q, rate = ca.SX.sym("q", n), ca.SX.sym("rate", n)
    axis = ca.SX(ca.DM([0, 0, 0, 0, 0, 1]))
    frames, bias, inertia, force = [], [], [], []
    twists: list[Any] = []
    for joint in found:
        c, s = ca.cos(q[joint.rate]), joint.sign * ca.sin(q[joint.rate])
        turn = ca.vertcat(ca.horzcat(c, -s, 0), ca.horzcat(s, c, 0), ca.horzcat(0, 0, 1))
        rotation, offset = _sparse(ca, joint.rotation) @ turn, _sparse(ca, joint.offset)
        before = twists[joint.parent] if joint.parent is not None else ca.SX(6, 1)
        own = axis * (joint.sign * rate[joint.rate])
        twist = ca.vertcat(rotation.T @ (before[:3] - ca.cross(offset, before[3:])), rotation.T @ before[3:]) + own
        h = _skew(ca, _sparse(ca, joint.mass * joint.centre))
        about = _sparse(ca, joint.inertia + joint.mass * ((joint.centre @ joint.centre) * np.eye(3) - np.outer(joint.centre, joint.centre)))
        body = ca.blockcat([[joint.mass * ca.SX.eye(3), -h], [h, about]])
        cross = ca.blockcat([[_skew(ca, twist[3:]), _skew(ca, twist[:3])], [ca.SX(3, 3), _skew(ca, twist[3:])]])
        frames, twists, bias = [*frames, (rotation, offset)], [*twists, twist], [*bias, cross @ own]
        inertia, force = [*inertia, body], [*force, -(cross.T @ (body @ twist))]
    carried: list[Any] = [None] * n
    for i in reversed(range(n)):
        u = inertia[i] @ axis
        d, rest = u[5], -force[i][5]
        carried[i] = u, d, rest
        if (parent := found[i].parent) is not None:
            left = inertia[i] - u @ u.T / d
            pushed = force[i] + left @ bias[i] + u * (rest / d)
            rotation, offset = frames[i]
            move = ca.blockcat([[rotation.T, -rotation.T @ _skew(ca, offset)], [ca.SX(3, 3), rotation.T]])
            inertia[parent], force[parent] = inertia[parent] + move.T @ left @ move, force[parent] + move.T @ pushed
    moving: list[Any] = []
    answer = ca.SX(n, 1)
    for i, joint in enumerate(found):
        rotation, offset = frames[i]
        before = moving[joint.parent] if joint.parent is not None else ca.SX(ca.DM([*(-g for g in gravity), 0.0, 0.0, 0.0]))
        here = ca.vertcat(rotation.T @ (before[:3] - ca.cross(offset, before[3:])), rotation.T @ before[3:]) + bias[i]
        u, d, rest = carried[i]
        acceleration = (rest - u.T @ here) / d
        answer[joint.rate] = joint.sign * acceleration
        moving.append(here + axis * acceleration)
    return ca.Function("articulated", [q, rate], ca.cse([answer]))


def _sparse(ca: ModuleType, numbers: np.ndarray) -> Any:
    """Constants, of which rounding is 0."""
    return ca.SX(ca.sparsify(ca.DM(np.where(np.abs(numbers) < 1e-14, 0.0, numbers))))


def _skew(ca: ModuleType, a: Any) -> Any:
    return ca.vertcat(ca.horzcat(0, -a[2], a[1]), ca.horzcat(a[2], 0, -a[0]), ca.horzcat(-a[1], a[0], 0))
