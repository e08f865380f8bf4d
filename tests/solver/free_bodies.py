"""Free bodies: what joints must do to every body of a motion, by Newton and Euler, and whether the wrenches of its neighbours do it.

The balance is made of positions, velocities and accelerations of points and unit vectors, without masses or rows of ncgen.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

import ncgen
from ncgen import Model
from ncgen.errors import ModelError
from ncgen.model.elements import Point

G = np.array([0.3, -9.81, 0.0])
CLOSED = 1e-9


@dataclass
class Setup:
    """A model and what is known of its bodies: mass (kg), centre (m), inertia (kg m²) at the start, forces at points and couples."""

    model: Model
    bodies: dict[str, tuple[float, np.ndarray, np.ndarray]] = field(default_factory=dict)
    forces: list[tuple[str, str, np.ndarray]] = field(default_factory=list)
    couples: list[tuple[str, np.ndarray]] = field(default_factory=list)
    springs: list[tuple[str, str, str, str, float, float]] = field(default_factory=list)

    def body(self, name, points, vectors, generator):
        m, mass = self.model, float(generator.uniform(0.5, 2.0))
        plane = not vectors and points[0].z.fixed
        centre = points[0].initial + generator.uniform(-0.3, 0.3, 3) * ([1, 1, 0] if plane else [1, 1, 1])
        if plane:
            inertia = np.diag([0, 0, float(generator.uniform(0.02, 0.1))])
            made = m.body(name, points, mass=mass, com=tuple(centre[:2]), inertia=inertia[2, 2])
        else:
            turn = np.linalg.qr(generator.standard_normal((3, 3)))[0]
            inertia = turn @ np.diag([0.05, 0.06, 0.08]) @ turn.T
            made = m.body(name, points, vectors, mass=mass, com=tuple(centre), inertia=inertia.tolist())
        self.bodies[name] = (mass, centre, inertia)
        return made

    def force(self, body, point, value):
        self.model.force(point, tuple(value))
        self.forces.append((body, point.name, np.array(value, float)))

    def couple(self, body, value):
        self.model.couple(body, tuple(value))
        self.couples.append((body, np.array(value, float)))

    def spring(self, first, start, second, end, stiffness, rest):
        self.model.spring(start, end, stiffness, free_length=rest)
        self.springs.append((first, start.name, second, end.name, stiffness, rest))


# -- the balance ----------------------------------------------------------------------------------


def histories(run, thing):
    """Positions, velocities and accelerations (K, 3) of an element."""
    at = [np.tile(thing.initial, (len(run.t), 1)), np.zeros((len(run.t), 3)), np.zeros((len(run.t), 3))]
    for axis, c in enumerate(thing.components):
        if not c.fixed:
            for own, whole in zip(at, (run.q, run.qd, run.qdd), strict=True):
                own[:, axis] = whole[:, run.kernels.index[c.name]]
    return at


def motion_of(run, body):
    """Reference point: positions, accelerations (K, 3); rotations from the start (K, 3, 3), angular velocities and accelerations (K, 3)."""
    elements = run.model.bodies[body].elements
    found = [histories(run, e) for e in elements]
    points = [i for i, e in enumerate(elements) if isinstance(e, Point)]
    origin = points[0]
    plane = all(e.z.fixed for e in elements) and all(isinstance(e, Point) for e in elements)
    place, rotations, omegas, alphas = found[origin], [], [], []
    for k in range(len(run.t)):
        arms, first, rates, bends = [], [], [], []
        for i, e in enumerate(elements):
            if i == origin:
                continue
            here, there = [each[k] for each in found[i]], [each[k] for each in found[origin]]
            if isinstance(e, Point):
                here = [a - b for a, b in zip(here, there, strict=True)]
            arms.append(here[0])
            rates.append(here[1])
            bends.append(here[2])
            first.append(e.initial - elements[origin].initial if isinstance(e, Point) else e.initial)
        if plane:  # what is out of it stands still
            arms, first = [*arms, np.eye(3)[2]], [*first, np.eye(3)[2]]
            rates, bends = [*rates, np.zeros(3)], [*bends, np.zeros(3)]
        left, _, right = np.linalg.svd(np.array(arms).T @ np.array(first))
        rotations.append(left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right)
        skew = np.vstack([np.cross(np.eye(3), arm).T for arm in arms])
        omega = np.linalg.lstsq(skew, np.concatenate(rates), rcond=None)[0]
        bend = [b - np.cross(omega, np.cross(omega, arm)) for b, arm in zip(bends, arms, strict=True)]
        omegas.append(omega)
        alphas.append(np.linalg.lstsq(skew, np.concatenate(bend), rcond=None)[0])
    return elements[origin], place[0], place[2], np.array(rotations), np.array(omegas), np.array(alphas)


def demanded(setup, run, body, gravity=G):
    """Force and moment about the origin (K, 3) that joints must have on a body."""
    mass, centre, inertia = setup.bodies[body]
    origin, place, acceleration, rotations, omega, alpha = motion_of(run, body)
    arm = rotations @ (centre - origin.initial)
    at = place + arm
    force = mass * (acceleration + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm)) - gravity)
    tensor = rotations @ inertia @ rotations.transpose(0, 2, 1)
    spin = np.einsum("kij,kj->ki", tensor, omega)
    moment = np.einsum("kij,kj->ki", tensor, alpha) + np.cross(omega, spin) + np.cross(at, force)
    pushes = [(run.point(point), np.tile(value, (len(run.t), 1))) for name, point, value in setup.forces if name == body]
    for first, start, second, end, stiffness, rest in setup.springs:
        line = run.point(end) - run.point(start)
        size = np.linalg.norm(line, axis=1, keepdims=True)
        pull = stiffness * (size - rest) * line / size
        pushes += [(run.point(start), pull)] * (first == body) + [(run.point(end), -pull)] * (second == body)
    for where, push in pushes:
        force, moment = force - push, moment - np.cross(where, push)
    return force, moment - sum((value for name, value in setup.couples if name == body), np.zeros(3))


def closes(setup, expected, gravity=G):
    """Every body's neighbours together do what is demanded, each what the other one feels of it; expected: pairs with a joint."""
    run = ncgen.simulate(ncgen.compile(setup.model), 0.3, points=4, rtol=1e-11)
    found, names = run.reactions(), ("ground", *setup.bodies)
    origin = next(e.name for e in setup.model.elements.values() if isinstance(e, Point) and e.fixed and not np.any(e.initial))
    sizes, wrenches = [], {}
    for body in setup.bodies:
        for other in names:
            if other != body:
                try:
                    wrenches[body, other] = found.wrench(body, origin, neighbour=other)
                except ModelError as error:
                    assert "shares no point and no vector" in str(error), error
    assert {tuple(sorted(pair)) for pair in wrenches} == {tuple(sorted(pair)) for pair in expected}
    sizes = max(np.max(np.abs(part)) for wrench in wrenches.values() for part in wrench)
    for body in setup.bodies:
        force, moment = demanded(setup, run, body, np.array(gravity))
        mine = [wrench for (name, _), wrench in wrenches.items() if name == body]
        assert np.max(np.abs(sum(w[0] for w in mine) - force)) < CLOSED * sizes
        assert np.max(np.abs(sum(w[1] for w in mine) - moment)) < CLOSED * sizes
    for (body, other), (force, moment) in wrenches.items():
        if other != "ground":
            assert np.max(np.abs(force + wrenches[other, body][0])) < CLOSED * sizes
            assert np.max(np.abs(moment + wrenches[other, body][1])) < CLOSED * sizes
