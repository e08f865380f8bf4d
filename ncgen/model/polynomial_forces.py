"""Force types whose laws are polynomials: springs and dampers along a coordinate, of balls and of places of bodies, and constant forces.

Turning from where a ball is at rest is the vector θ n of angle and axis. With three directions a of the parent that are b on the child
where nothing has turned, Σ a × b = 2 sin θ n and Σ a · b = 1 + 2 cos θ. The angular velocity of three such directions is ½ Σ b × ḃ.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from ncgen.model.catalogue import Formula, Triple, cross, dot
from ncgen.model.elements import Combination, Component, Relative
from ncgen.model.forces import BodyLoad, ForceType, Load, on_directions, on_pair
from ncgen.model.values import Value

LEAST_SINE = 1e-15
"""Added to the sine of a turning (1), or to a distance (m), whose quotients are then defined where nothing has moved."""

SERIES = ("k", "k2", "k3", "c", "c2", "c3")
"""Names of coefficients: the tension over a value x is k + k₂ x + k₃ x², over a rate v it is c + c₂ |v| + c₃ v²."""


def _elastic(x: Any, data: Mapping[str, Any]) -> Any:
    """Tension over a value."""
    return data["k"] + data["k2"] * x + data["k3"] * x**2


def _viscous(f: Any, v: Any, data: Mapping[str, Any]) -> Any:
    """Tension over a rate, but for c."""
    return data["c2"] * f.Abs(v) + data["c3"] * v**2


def _sum(vectors: Iterable[Triple[Any]]) -> Triple[Any]:
    return [sum(components) for components in zip(*vectors, strict=True)]


def _turning(axes: Sequence[Triple[Any]], others: Sequence[Triple[Any]]) -> Triple[Any]:
    """½ Σ a × b: of directions and their rates, the angular velocity."""
    return [x / 2 for x in _sum(cross(*pair) for pair in zip(axes, others, strict=True))]


def _ball(apply: Formula, f: Any, **arguments: Any) -> Any:
    """The couple that turns the directions b back to a, with its sign s, by forces on the directions x of a body that come first."""
    a, b, da, db = ([arguments[f"{name}{i}"] for i in (1, 2, 3)] for name in ("a", "b", "da", "db"))
    across = _turning(a, b)
    sine = f.sqrt(dot(across, across) + LEAST_SINE**2)
    angle = f.atan2(sine, (sum(dot(*pair) for pair in zip(a, b, strict=True)) - 1) / 2)
    elastic = _elastic(angle, arguments) * angle / sine
    velocity = [x - y for x, y in zip(_turning(b, db), _turning(a, da), strict=True)]
    rates = [dot(velocity, axis) for axis in b]
    more = _sum([_viscous(f, rate, arguments) * rate * x for x in axis] for axis, rate in zip(b, rates, strict=True))
    couple = [-arguments["s"] * (elastic * x + arguments["c"] * v + w) for x, v, w in zip(across, velocity, more, strict=True)]
    directions = [vector for name, vector in arguments.items() if name.startswith("x")]
    return apply(f, *directions, *couple, arguments["V"])


def _back(f: Any, a: Triple[Any], da: Triple[Any], **data: Any) -> Any:
    """Against the displacement a along it, and against its rate along every global axis."""
    elastic = _elastic(f.sqrt(dot(a, a) + LEAST_SINE**2), data)
    return [[-elastic * x - (data["c"] + _viscous(f, v, data)) * v for x, v in zip(a, da, strict=True)]]


def _energy(f: Any, r: Triple[Any], fx: Any, fy: Any, fz: Any) -> Any:
    return -dot((fx, fy, fz), r)


def _along_potential(f: Any, x: Any, L0: Any, k: Any, k2: Any, k3: Any, **others: Any) -> Any:
    s = x - L0
    return k * s**2 / 2 + k2 * s**3 / 3 + k3 * s**4 / 4


def _along_friction(f: Any, x: Any, v: Any, **data: Any) -> Any:
    return (data["c"] + _viscous(f, v, data)) * v


PARENT_AXES, CHILD_AXES = ("a1", "a2", "a3"), ("b1", "b2", "b3")


@dataclass(frozen=True, eq=False)
class PolynomialSpring(Load):
    """Spring and damper along a relative coordinate."""

    label: str
    coordinate: Relative
    series: Sequence[Value]
    free: Value

    kind = ForceType(
        key="polynomial-spring",
        vectors=(),
        scalars=("x",),
        data=(*SERIES, "L0"),
        equation="k s^2 / 2 + k2 s^3 / 3 + k3 s^4 / 4 at s = x - x0, damper c + c2 |v| + c3 v^2",
        potential=_along_potential,
        friction=_along_friction,
    )

    def given(self) -> tuple[list[Combination | Component], list[Value]]:
        return [self.coordinate.components[0]], [*self.series, self.free]


@dataclass(frozen=True, eq=False)
class BallSpring(BodyLoad):
    """What a spring and a damper against turning do to one of two bodies.

    before, after: three perpendicular unit directions that turn with the parent and with the child, and that are the same at rest
    way: 1 on the child, −1 on the parent
    """

    before: Sequence[Combination]
    after: Sequence[Combination]
    series: Sequence[Value]
    way: float

    kind = ForceType(
        key="ball-spring",
        vectors=("x1", "x2", "x3", *PARENT_AXES, *CHILD_AXES),
        scalars=(),
        data=(*SERIES, "s", "V"),
        equation="couple s (k + k2 h + k3 h^2) h against turning by h, damper c + c2 |w| + c3 w^2",
        forces=partial(_ball, on_directions),
        takes_rates=True,
    )
    on_pair = ForceType(
        key="ball-spring-on-pair",
        vectors=("x1", "x2", *PARENT_AXES, *CHILD_AXES),
        scalars=(),
        data=(*SERIES, "s", "V"),
        equation=kind.equation,
        forces=partial(_ball, on_pair),
        takes_rates=True,
    )

    @property
    def type(self) -> ForceType:
        return self.on_pair if len(self.body.frame.directions) == 2 else self.kind

    def given(self) -> tuple[list[Combination | Component], list[Value]]:
        directions, volume = self.turned_by()
        return [*directions, *self.before, *self.after], [*self.series, self.way, volume]


@dataclass(frozen=True, eq=False)
class AnchorSpring(BodyLoad):
    """A spring that pulls a place of a body back to where it was, and a damper against its velocity."""

    displacement: Combination
    series: Sequence[Value]

    kind = ForceType(
        key="anchor-spring",
        vectors=("a",),
        scalars=(),
        data=SERIES,
        equation="-(k + k2 |a| + k3 |a|^2) a, damper c + c2 |v| + c3 v^2 along every axis",
        forces=_back,
        takes_rates=True,
    )

    def given(self) -> tuple[list[Combination | Component], list[Value]]:
        return [self.displacement], [*self.series]


@dataclass(frozen=True, eq=False)
class ConstantForce(BodyLoad):
    """A constant force (N, global axes) at a place of a body."""

    attachment: Combination
    components: Sequence[Value]

    kind = ForceType(
        key="constant-force",
        vectors=("r",),
        scalars=(),
        data=("fx", "fy", "fz"),
        equation="-f.r",
        energy=_energy,
    )

    def given(self) -> tuple[list[Combination | Component], list[Value]]:
        return [self.attachment], [*self.components]


POLYNOMIAL_FORCE_TYPES = (PolynomialSpring.kind, BallSpring.kind, BallSpring.on_pair, AnchorSpring.kind, ConstantForce.kind)
"""The force types of this part of the catalogue."""
