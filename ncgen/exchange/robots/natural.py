"""A robot as a model: joints become shared points and vectors, and their coordinates carry the names and signs of the file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.robots.balance import remedy
from ncgen.exchange.robots.layout import Hold, Layer, Layout, PlannedElement, RobotSolid
from ncgen.exchange.robots.parameters import GEOMETRY, Parts, Shift, add_part, homes_of, parts_of, shifted, shifts_of
from ncgen.exchange.robots.passive import lift, series, spring_of_ball
from ncgen.exchange.robots.placement import rotation_about
from ncgen.exchange.robots.robot import Coupling, Joint, Link, Mass, Robot, changes_nothing, together
from ncgen.exchange.robots.stops import FRICTION, LIMITS, add_friction, add_stops, left
from ncgen.model import Model
from ncgen.model.arithmetic import across, dot, product
from ncgen.model.bodies import Body, BodyFrame, choose_basis
from ncgen.model.elements import Combination, Point, Relative, Spatial, Vector, as_combination
from ncgen.model.names import numbered, word

DURATION = 1.0
"""Of a run that says nothing else (s)."""

INERTIA_ROUNDING = 1e-15
"""Entries of a tensor below this, over mass · size² of the robot, are rounding of whoever wrote the file."""


def model_of(
    robot: Robot,
    floating: bool | None = None,
    limits: bool | str = False,
    friction: bool | str = False,
    motors: bool = False,
    sensors: bool = False,
    parameters: Sequence[str] = (),
) -> Model:
    """The model of a robot whose joints are ordered, with all joint coordinates at 0.

    floating: the root is a free body instead of part of the ground; None for what the robot's file says
    limits, friction: joints have stops and dry friction (`ncgen.exchange.robots.stops`); else they are among what is left out
    sensors: outputs for sensors of the file (`ncgen.exchange.robots.sensors`)
    motors: inputs for actuators of the file, or for joints (`ncgen.exchange.robots.motors`)
    parameters: what becomes a parameter (`ncgen.exchange.robots.parameters`)
    Raises ModelError naming a link with an impossible inertia, or a joint that cannot be as it is described.
    """
    floats = robot.floats if floating is None else floating
    if sensors and any(name == GEOMETRY or name in {joint.name for joint in robot.joints} for name in parameters):
        raise ModelError("parameters: sensors are where the file has them; leave geometry or sensors out")
    builder = _Builder(robot, floats, parameters)
    model = builder.build()
    model.frames = _frames_of(robot, builder.layout.ground.name, {solid.name: body.name for solid, body in builder.bodies.items()})
    acting = [(hold.joint, builder.coordinates[hold.joint.name]) for hold in builder.layout.holds if hold.joint.name in builder.coordinates]
    model.limits = {coordinate.name: joint.limits for joint, coordinate in acting if joint.limits is not None}
    for wanted, add, words in ((limits, add_stops, LIMITS), (friction, add_friction, FRICTION)):
        if wanted:
            model.left_out = left(model.left_out, words, add(model, acting, wanted))
    if motors:
        _add_motors(builder, robot, {joint.name: joint for joint, _ in acting})
    if sensors:
        _add_sensors(builder, robot)
    model.keeps_state = True
    return model


def _add_motors(builder: _Builder, robot: Robot, joints: Mapping[str, Joint]) -> None:
    """Inputs, and their values in named starts; joints: those with a coordinate."""
    from ncgen.exchange.robots.motors import AWAY_FROM_ZERO, EFFORTS, MOTORS, add_motors, away_from_zero

    model = builder.model
    inputs = add_motors(model, robot, joints, builder.coordinates)
    bounded = sum(joint.effort is not None and joint.mimic is None for joint in joints.values())
    for words, count in ((MOTORS, len(inputs)), (EFFORTS, bounded), (AWAY_FROM_ZERO, len(away_from_zero(robot, joints)))):
        model.left_out = left(model.left_out, words, count)
    for name, start in robot.starts.items():
        model.starts[name]["inputs"] = {inputs[each]: value for each, value in start.inputs.items() if each in inputs}


def _add_sensors(builder: _Builder, robot: Robot) -> None:
    """Outputs."""
    from ncgen.exchange.robots.sensors import SENSORS, add_sensors

    model = builder.model
    frames = {
        name: (builder.bodies[solid], builder.layout.frames[link] @ placement)
        for link, solid in builder.layout.solids.items()
        for name, placement in builder.robot.links[link].frames.items()
    }
    model.left_out = left(model.left_out, SENSORS, add_sensors(model, robot, frames, builder.coordinates))


def _frames_of(robot: Robot, ground: str, bodies: Mapping[str, str]) -> dict[str, BodyFrame]:
    """Frames of links, and those that the file names on them, in the initial position. Where a link and another frame have one name,
    both are called with their kind: body:head and site:head.

    bodies: {link without those fixed to it: name of its body}, the ground's among them
    """
    homes, placements, links = homes_of(robot), robot.frames(robot.base), robot.links
    origins, others = dict[str, BodyFrame](), dict[str, BodyFrame]()
    for name, at in placements.items():
        body, link = bodies[homes[name]], links[name]
        for named_places, named in ((origins, {name: link.origin} if link.origin else {}), (others, link.sites)):
            for each, placement in named.items():
                stands = at @ placement
                named_places[each] = BodyFrame(body, stands.rotation, stands.position)
    others |= {name: BodyFrame(bodies[ground], placement.rotation, placement.position) for name, placement in robot.resting.items()}
    both = origins.keys() & others.keys()
    kinds = zip(robot.words, (origins, others), strict=True)
    return {f"{kind}:{name}" if name in both else name: frame for kind, named in kinds for name, frame in named.items()}


class _Builder:
    def __init__(self, robot: Robot, floating: bool, as_parameters: Sequence[str]) -> None:
        self.robot, self.floating = together(robot), floating
        self.model = Model(word(robot.name, "robot"))
        self.model.has_separate_numbers = True
        self.model.keeps_state = False  # nobody has the model if a call is refused
        self.parts: Mapping[str, Parts] = parts_of(robot, floating, as_parameters) if as_parameters else {}
        self.shifts: Mapping[str, Shift] = shifts_of(self.model, robot, as_parameters) if as_parameters else {}
        self.layout: Layout = Layer(self.robot, floating, bool(self.shifts)).layout()
        self.elements: dict[PlannedElement, Spatial] = {}
        self.bodies: dict[RobotSolid, Body] = {self.layout.ground: self.model.ground}
        self.coordinates: dict[str, Relative] = {}

    def build(self) -> Model:
        model = self.model
        self._elements()
        for solid in self.layout.solids.values():
            self._body(solid)
        for solid, body in self.bodies.items():
            self._show(solid, body)
        for hold in self.layout.holds:
            with _labelled_errors(hold.joint.where):
                self._join(hold)
        for hold in self.layout.holds:
            self._follow(hold)
        for coupling in self.robot.rows:
            self._couple(coupling)
        self._lift()
        self._draw()
        free = [c for hold in self.layout.holds if (c := self.coordinates.get(hold.joint.name)) and not hold.joint.mimic]
        if not (self.robot.loops or self.robot.rows):
            model.independent(*free)
        model.gravity(self.robot.gravity)
        model.simulation(duration=DURATION)
        model.left_out, model.assembled = self.robot.omitted, self.robot.assembled
        if self.robot.starts:
            self._start()
        return model

    def _start(self) -> None:
        """Named starts."""
        from ncgen.exchange.robots.starts import NamedStarts

        members = {solid.name: self.bodies[solid].elements for solid in self.layout.solids.values()}
        self.model.starts = NamedStarts(self.robot, self.layout.frames, members, self.coordinates)

    def _elements(self) -> None:
        fixed = set(self.layout.ground.planned)
        for solid in (self.layout.ground, *self.layout.solids.values()):
            for planned in solid.planned:
                if planned not in self.elements:
                    make = self.model.point if planned.is_point else self.model.vector
                    with _labelled_errors(self.robot.links[solid.name].where):
                        value = shifted(planned.value, self.shifts.get(planned.link)) if planned.is_point else planned.value.tolist()
                        self.elements[planned] = make(self._free(planned.name), value, fixed=planned in fixed)

    def _free(self, name: str) -> str:
        """A name that nothing has yet."""
        return self.model.free_name(word(name, "joint"))

    def _body(self, solid: RobotSolid) -> None:
        link, frame, parts = self.robot.links[solid.name], self.layout.frames[solid.name], self.parts.get(solid.name)
        mass = parts.fixed if parts else link.mass.seen_from(frame) if link.mass else None
        elements = [self.elements[planned] for planned in solid.planned]
        points = [e for e in elements if isinstance(e, Point)]
        vectors = [e for e in elements if isinstance(e, Vector)]
        name = numbered(word(solid.name, "link"), lambda name: name in self.model.bodies or name == self.model.ground.name)
        tensor, as_given = _tensor(mass, self.layout.size).tolist() if mass else [], self._as_given(solid.name)
        with _labelled_errors(link.where, link):
            basis, shift = None, self.shifts.get(solid.name)
            if shift is not None:  # vectors span it: they stay numbers
                body = self.bodies[solid] = self.model.body(name, points[:1], vectors)
                basis = choose_basis(body)
                self.model.extend(body, *points[1:])
                if mass is not None:
                    self.model.payload(body, name, mass.mass, shifted(mass.com, shift), tensor, basis, **as_given)
            elif mass is None:
                self.bodies[solid] = self.model.body(name, points, vectors)
            else:
                self.bodies[solid] = self.model.body(name, points, vectors, mass.mass, mass.com.tolist(), tensor, **as_given)
            for rigid_part in parts.chosen if parts else ():
                add_part(
                    self.model, self.bodies[solid], rigid_part, word(rigid_part.name, "link"), self._as_given(rigid_part.name), shift, basis
                )

    def _as_given(self, link: str) -> dict[str, Any]:
        """The argument that marks a link whose moments of inertia no body has; empty for others, of which a model's file says nothing."""
        return {"as_given": True} if link in self.robot.as_given else {}

    def _show(self, solid: RobotSolid, body: Body) -> None:
        """What a link looks like, on its body."""
        if self.floating and body is self.model.ground:
            return
        link, frame = self.robot.links[solid.name], self.layout.frames[solid.name]
        for shape in link.shapes:
            shape.seen_from(frame).show(self.model, body)

    def _lift(self) -> None:
        """Compensated weights of what moves."""
        for solid in self.layout.solids.values():
            frame = self.layout.frames[solid.name]
            if masses := [mass.seen_from(frame) for mass in self.robot.links[solid.name].lifted]:
                lift(self.model, self.bodies[solid], masses, self.robot.gravity)

    # -- joints --------------------------------------------------------------------------------

    def _join(self, hold: Hold) -> None:
        a, b, joint = self.bodies[hold.parent], self.bodies[hold.child], hold.joint
        if joint.kind == "revolute" and (not hold.closes or joint.has_spring):
            self.coordinates[joint.name] = self._angle(hold, a, b)
        elif joint.kind == "prismatic":
            start, end, axis = self._point(hold.start), self._point(hold.end), self._vector(hold.axis)
            self.model.prismatic(a, b, start, end, axis)
            if not hold.closes or joint.has_spring:
                zero = self._zero(joint, a, start, hold.sign * axis.initial)
                self.coordinates[joint.name] = self.model.slide(self._free(joint.name), zero, end, hold.sign * axis)
        elif joint.kind == "planar":
            self.model.planar(a, b, self._point(hold.start), self._point(hold.end), self._vector(hold.axis))
        elif joint.kind == "universal":
            self.model.universal(a, b, self._point(hold.start), self._vector(hold.axis), self._vector(hold.second))
        elif joint.kind == "screw":
            self.coordinates[joint.name] = self._screw(hold, a, b)
        elif joint.kind == "fixed":
            self._weld(joint, a, b)
        if joint.armature and (coordinate := self.coordinates.get(joint.name)):
            self.model.rotor(coordinate, joint.armature)
        if joint.has_spring:
            self._spring(hold, a, b)

    def _spring(self, hold: Hold, a: Body, b: Body) -> None:
        """Spring and damper of a joint."""
        joint = hold.joint
        if coordinate := self.coordinates.get(joint.name):
            label = f"spring of {coordinate.name}"
            if any((*joint.more_stiffness, *joint.more_damping)):
                self.model.polynomial_spring(coordinate, *series(joint), joint.rest, label)
            else:
                self.model.torsion_spring(coordinate, joint.stiffness, joint.damping, joint.rest, label=label)
        elif joint.kind in ("spherical", "floating"):
            spring_of_ball(self.model, a, b, joint, self.layout.frames[hold.child.name])

    def _screw(self, hold: Hold, a: Body, b: Body) -> Relative:
        """The angle of a screw, 0 as the file says it, and how far it goes with that."""
        start, end, axis = self._point(hold.start), self._point(hold.end), self._vector(hold.axis)
        self.model.cylindrical(a, b, start, end, axis)
        angle = self._angle(hold, a, b)
        slide = self.model.slide(self._free(f"{hold.joint.name}.slide"), start, end, hold.sign * axis)
        self.model.constrain(slide.symbol - hold.joint.pitch / (2 * np.pi) * angle.symbol, f"screw {angle.name}")
        return angle

    def _weld(self, joint: Joint, a: Body, b: Body) -> None:
        before = len(self.model.rows)
        self.model.rigid(a, b)
        if len(self.model.rows) == before:
            raise ModelError(changes_nothing(joint, "its links move together already"))

    def _angle(self, hold: Hold, a: Body, b: Body) -> Relative:
        """A hinge's angle, measured from a direction of the parent to one of the child which are the same at 0."""
        axis = self._vector(hold.axis)
        across = _across(axis.initial, [planned.value for solid in (hold.child, hold.parent) for planned in solid.vectors])
        begins = hold.joint.start
        back = product(rotation_about(hold.sign * axis.initial, -begins), across) if begins else across
        start, end = self._direction(a, back, hold), self._direction(b, across, hold)
        # What is measured is this but for rounding, which is other rounding for other lengths of the robot.
        is_known = not any(as_combination(direction).is_parametric for direction in (start, end, axis))
        known: dict[str, Any] = {"lengths": (1.0, 1.0, 1.0), "initial": float(begins)} if is_known else {"initial": begins or None}
        return self.model.angle(self._free(hold.joint.name), start, end, hold.sign * axis, **known)

    def _zero(self, joint: Joint, a: Body, start: Point, axis: np.ndarray) -> Point:
        """The point of the parent from which a slider counts."""
        if not joint.start:
            return start
        position = [x - joint.start * float(e) for x, e in zip(start.given, axis, strict=True)]
        name = self._free(f"z_{joint.name}")
        return self.model.point(name, position, fixed=True) if a is self.model.ground else self.model.attach_point(a, name, position)

    def _direction(self, body: Body, direction: np.ndarray, hold: Hold) -> Spatial | Combination:
        """A direction of a body; on the ground one of its vectors, or a new one."""
        if body is self.model.ground:
            known = (self._vector(planned) for planned in self.layout.ground.vectors if np.array_equal(planned.value, direction))
            return next(known, None) or self.model.vector(self._free(f"e_{hold.joint.name}"), direction.tolist(), fixed=True)
        global_direction = self.model.direction_of(body, direction, "across")
        return (
            global_direction.elements[0] if len(global_direction.terms) == 1 and global_direction.terms[0][0] == 1.0 else global_direction
        )

    def _follow(self, hold: Hold) -> None:
        """The row of a joint that follows another one."""
        joint, mimic = hold.joint, hold.joint.mimic
        if mimic is None:
            return
        follower, other = self.coordinates.get(joint.name), self.coordinates.get(mimic.joint)
        if follower is None or other is None:
            why = f"joint {joint.name} is no hinge or slider" if follower is None else f"there is no joint {shown(mimic.joint)} that moves"
            raise ModelError(f"{joint.where}: joint {joint.name}: {why}, so one cannot mimic the other")
        if follower is other:
            raise ModelError(f"{joint.where}: joint {joint.name} mimics itself; name another joint")
        self.model.follow(follower, other, mimic.factor, mimic.offset)

    def _couple(self, coupling: Coupling) -> None:
        """The row of joints that move together."""
        if missing := [name for name in (*coupling.shares, *coupling.others) if name not in self.coordinates]:
            raise ModelError(
                f"{coupling.where}: {coupling.name}: joint {missing[0]} is no hinge or slider, so nothing can be coupled to it"
            )
        total, other = (
            sum(coefficient * (self.coordinates[name].symbol - coupling.zeros.get(name, 0.0)) for name, coefficient in shares.items())
            for shares in (coupling.shares, coupling.others)
        )
        follows = sum(factor * other**power for power, factor in enumerate(coupling.powers, 1) if factor)
        self.model.constrain(total - follows - coupling.offset, coupling.name)

    def _draw(self) -> None:
        """Every body from the joint that carries it to the others, and the axes of the joints."""
        carried = {hold.child: hold.end for hold in self.layout.holds if hold.end and not hold.closes}
        for solid in self.layout.solids.values():
            first = carried.get(solid) or solid.points[0]
            for planned in solid.points:
                if planned is not first:
                    self.model.line(self._point(first), self._point(planned))
        for hold in self.layout.holds:
            if hold.axis and hold.end:
                self.model.arrow(self._point(hold.end), self._vector(hold.axis))

    def _point(self, planned: PlannedElement | None) -> Point:
        assert planned is not None
        point = self.elements[planned]
        assert isinstance(point, Point)
        return point

    def _vector(self, planned: PlannedElement | None) -> Vector:
        assert planned is not None
        vector = self.elements[planned]
        assert isinstance(vector, Vector)
        return vector


@contextmanager
def _labelled_errors(where: str, link: Link | None = None) -> Iterator[None]:
    """Report refusals of the model with the place in the robot's file, and what else can be done for a link's inertia."""
    try:
        yield
    except ModelError as error:
        message = f"{error}{remedy(link) if link else ''}"
        raise ModelError(f"{where}: {message}" if where else message) from None


def _tensor(mass: Mass, size: float) -> np.ndarray:
    """The tensor about the centre of mass without what is rounding; size: of the robot (m)."""
    tensor = (mass.tensor + mass.tensor.T) / 2
    return np.where(np.abs(tensor) < INERTIA_ROUNDING * mass.mass * size**2, 0.0, tensor)


def _across(axis: np.ndarray, known: list[np.ndarray]) -> np.ndarray:
    """A direction perpendicular to an axis: one of those that are known, if there is one."""
    for direction in known:
        if abs(dot(direction, axis)) < 1e-12:
            return direction
    return across(axis)
