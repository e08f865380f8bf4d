"""Random planar mechanisms, as someone who draws makes them: bars and plates on pins, slots, sliders, springs, gears and drives."""

from __future__ import annotations

import numpy as np

from ncgen import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import Point


class Drawn:
    """A mechanism that grows: every new body hangs on what is there."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.model = Model(f"drawn{seed}")
        self.x = self.model.vector("x", (1, 0, 0), fixed=True)
        self.z = self.model.vector("z", (0, 0, 1), fixed=True)
        self.pins = [self.point(fixed=True), self.point(fixed=True)]
        self.angles = []
        for _ in range(self.random.integers(1, 5)):
            self.add_body()
        self.add_extras()

    def point(self, fixed: bool = False) -> Point:
        place = self.random.uniform(-1, 1, 2)
        return self.model.point(f"P{len(self.model.elements)}", place, fixed=fixed)

    def pick(self, things: list) -> object:
        return things[self.random.integers(len(things))]

    def add_body(self) -> Body:
        """A bar, a plate of three points or a point mass, with a pin on what is there."""
        m, start = self.model, self.pick(self.pins)
        new = [self.point() for _ in range(self.random.integers(1, 3))]
        size, mass = float(np.linalg.norm(new[0].initial - start.initial)), float(self.random.uniform(0.1, 2))
        name = f"body{len(m.bodies)}"
        if len(new) == 1:
            body = m.body(name, [start, *new], mass=mass, inertia="rod")
        else:
            com = np.mean([p.initial[:2] for p in (start, *new)], axis=0)
            body = m.body(name, [start, *new], mass=mass, com=com, inertia=mass * size**2 / 10)
        self.pins += new
        if self.random.random() < 0.6:
            self.angles.append(m.angle(f"psi{len(m.bodies)}", self.x, new[0] - start, self.z))
        return body

    def line_through(self, point: Point) -> tuple[Point, Point]:
        """Two fixed points on a line through a point."""
        along = self.random.uniform(-1, 1, 2)
        ends = [self.model.point(f"L{len(self.model.elements)}", point.initial[:2] + k * along, fixed=True) for k in (-1, 2)]
        return ends[0], ends[1]

    def add_extras(self) -> None:
        """A slot, a slider, a closing bar, springs, a gear, a drive: some of them."""
        m, chance = self.model, self.random.random(6)
        moving = [p for p in self.pins if not p.fixed]
        m.gravity((0, -9.81))
        if chance[0] < 0.4:
            start, end = self.line_through(moving[-1])
            m.point_on_line(m.ground, moving[-1], start, end - start)
        if chance[1] < 0.3:
            block = self.add_body()
            start, end = self.line_through(block.points[-1])
            m.slider(m.ground, block, start, block.points[-1], end - start)
        if chance[2] < 0.4:
            m.distance(self.pins[1], moving[-1])
        for _ in range(self.random.integers(0, 3)):
            end = self.pick(moving)
            m.spring(self.pins[0], end, stiffness=50.0, damping=0.5, free_length=float(self.random.uniform(0.2, 1)))
        if len(self.angles) > 1 and chance[4] < 0.5:
            m.gear(self.angles[0], self.angles[1], 0.2, float(self.random.uniform(0.1, 0.4)))
        if self.angles:
            start = self.angles[-1].components[0].initial
            if chance[5] < 0.5:
                m.drive(self.angles[-1], start + 2.0 * m.time)
            else:
                m.torque(self.angles[-1], 0.3)
                m.torsion_spring(self.angles[-1], stiffness=1.0, damping=0.1)
