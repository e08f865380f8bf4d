"""Sensors of a robot's file as outputs of its model, where they are asked for; a vector has one for each axis, NAME.x and so on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ncgen.exchange.robots.passive import expressions, turning_of
from ncgen.exchange.robots.placement import Placement
from ncgen.exchange.robots.robot import Robot, Sensor
from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.elements import AXES, Combination, Relative

if TYPE_CHECKING:
    import sympy

SENSORS = "sensors"
"""The word for them among what is left out."""


@dataclass(frozen=True, eq=False)
class _Frame:
    """A frame of a body: its origin and its axes, as they move."""

    origin: Combination
    axes: Sequence[Combination]

    @property
    def turning(self) -> sympy.Matrix:
        """The angular velocity (rad/s)."""
        return self._turned(1)

    @property
    def more_turning(self) -> sympy.Matrix:
        """The angular acceleration (rad/s²): ½ Σ b × b̈, since ḃ × ḃ = 0."""
        return self._turned(2)

    def _turned(self, order: int) -> sympy.Matrix:
        return turning_of([expressions(axis) for axis in self.axes], [expressions(axis, order) for axis in self.axes])

    def seen(self, vector: sympy.Matrix) -> sympy.Matrix:
        """A vector by its components along the axes."""
        import sympy

        return sympy.Matrix([vector.dot(expressions(axis)) for axis in self.axes])


Reading = tuple[str, Callable[[_Frame, Model, Sensor], "sympy.Matrix"]]


def _numbers(vector: Sequence[float]) -> sympy.Matrix:
    import sympy

    return sympy.Matrix([float(x) for x in vector])


OF_FRAMES: Mapping[str, Reading] = {
    "position": ("m", lambda f, m, s: expressions(f.origin)),
    "x axis": ("1", lambda f, m, s: expressions(f.axes[0])),
    "y axis": ("1", lambda f, m, s: expressions(f.axes[1])),
    "z axis": ("1", lambda f, m, s: expressions(f.axes[2])),
    "velocity": ("m/s", lambda f, m, s: expressions(f.origin, 1)),
    "angular velocity": ("rad/s", lambda f, m, s: f.turning),
    "acceleration": ("m/s2", lambda f, m, s: expressions(f.origin, 2) - _gravity(m)),
    "angular acceleration": ("rad/s2", lambda f, m, s: f.more_turning),
    "accelerometer": ("m/s2", lambda f, m, s: f.seen(expressions(f.origin, 2) - _gravity(m))),
    "velocimeter": ("m/s", lambda f, m, s: f.seen(expressions(f.origin, 1))),
    "gyro": ("rad/s", lambda f, m, s: f.seen(f.turning)),
    "magnetometer": ("T", lambda f, m, s: f.seen(_numbers(s.field))),
}
"""{kind: unit and reading in a frame}: from position to angular acceleration in the axes of the world, the others in those of the frame.
Accelerations are proper ones: at rest they are opposite to gravity."""


def _gravity(model: Model) -> sympy.Matrix:
    import sympy

    return sympy.Matrix(model.gravity_field)


def add_sensors(model: Model, robot: Robot, frames: Mapping[str, tuple[Body, Placement]], coordinates: Mapping[str, Relative]) -> int:
    """Outputs of all sensors; how many there are. frames: {name: the body, and where the frame is where the model begins}"""
    done = 0
    for sensor in robot.sensors:
        if isinstance(sensor.of, str):
            done += _in_frame(model, sensor, frames)
        else:
            done += _along(model, sensor, coordinates)
    return done


def _in_frame(model: Model, sensor: Sensor, frames: Mapping[str, tuple[Body, Placement]]) -> bool:
    if sensor.kind == "clock":
        model.output(_label(model, sensor.name), model.time, "s")
        return True
    if not isinstance(sensor.of, str) or sensor.of not in frames:
        return False  # on the ground
    body, frame = frames[sensor.of]
    axes = [model.direction_of(body, axis, "axis") for axis in frame.rotation.T.tolist()]
    unit, read = OF_FRAMES[sensor.kind]
    vector = read(_Frame(model.attached(body, frame.position.tolist(), sensor.name), axes), model, sensor)
    for axis, value in zip(AXES, vector.flat(), strict=True):
        model.output(_label(model, f"{sensor.name}.{axis}"), _cut(sensor, value), unit)
    return True


def _along(model: Model, sensor: Sensor, coordinates: Mapping[str, Relative]) -> bool:
    """A length, or its rate."""
    import sympy

    assert not isinstance(sensor.of, str), "a frame in place of joints"
    if not all(name in coordinates for name in sensor.of):
        return False
    is_rate = sensor.kind == "rate"
    parts = [(coefficient, coordinates[name]) for name, coefficient in sensor.of.items()]
    total = sympy.Add(*(coefficient * (c.rate if is_rate else c.symbol) for coefficient, c in parts))
    (unit, *others) = {c.unit for _, c in parts}
    unit = "" if others else f"{unit}/s" if is_rate else unit
    model.output(_label(model, sensor.name), _cut(sensor, total), unit)
    return True


def _cut(sensor: Sensor, value: sympy.Expr) -> sympy.Expr:
    """A reading between −c and c at a cutoff c: ½ (|x + c| − |x − c|), which writes x twice, where Min and Max write it four times."""
    import sympy

    c = sensor.cutoff
    return (sympy.Abs(value + c) - sympy.Abs(value - c)) / 2 if c > 0 else value


def _label(model: Model, wish: str) -> str:
    """A label that no output has yet."""
    from ncgen.model.names import numbered

    return numbered(wish, model.outputs.__contains__)
