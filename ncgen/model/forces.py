"""The catalogue of force types: one class a type, and the only place where its law is written down. Its objects are what a user gave.

A formula works on anything that can be added and multiplied, as those of rows do (`ncgen.model.catalogue`). Generalised forces,
energies, power, joint loads, tangents, C and NumPy follow from it, and the drawing from the elements that a force acts on.

Gravity is a property of the model, because it acts on every mass.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, TypeAlias

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import measures
from ncgen.model.bodies import Body
from ncgen.model.catalogue import Formula, Functions, N, Triple, cross
from ncgen.model.elements import Combination, Component, Relative
from ncgen.model.values import Scalar, Value, is_number

if TYPE_CHECKING:
    import sympy

Callback: TypeAlias = Callable[..., Sequence[float] | np.ndarray]
"""function(t, q, qd, kernels) -> generalised forces (n,)."""


def _none(f: Functions[N], x: N, *others: N, **data: N) -> N:
    return x * 0


@dataclass(frozen=True, eq=False, kw_only=True)
class ForceType:
    """A kind of force: a tension along the length of its one vector or along its one scalar, or forces along its vectors.

    vectors, scalars, data: names of the arguments and of the constants, as of a row type
    equation: the text printed next to the generated code, over these names
    potential(f, x, **data): the energy V (J) of the length or scalar x
    friction(f, x, v, **data): what the tension has in addition to V′, at the rate v
    forces(f, **arguments, **data): in place of both, a force along each of the first vectors; its power is counted as work
    takes_rates: True where it also takes the rates of the vectors, da of a
    energy(f, **arguments, **data): in place of all these, the potential energy (J) of vectors, whose negative gradient the forces are
    regular: True where V′ and friction, each times a/|a|, can be taken at |a| = 0, and so are not added up first
    """

    key: str
    vectors: tuple[str, ...]
    scalars: tuple[str, ...]
    data: tuple[str, ...]
    equation: str
    potential: Formula = _none
    friction: Formula = _none
    forces: Formula | None = None
    takes_rates: bool = False
    energy: Formula | None = None
    regular: bool = False


class Load:
    """A force type applied to elements: a class has its type, an object what a user gave.

    The fields of a class are a label (the user's words, for messages and comments), what the type's arguments stand for, then its
    constants; law, where a class has it, is an expression of x and v in place of the type's tension.
    """

    kind: ClassVar[ForceType]
    label: str
    law: sympy.Expr | None = None

    @property
    def type(self) -> ForceType:
        return self.kind

    def given(self) -> tuple[list[Combination | Component], list[Value]]:
        """What the vectors (combinations) and scalars (components) of the type stand for, and the values of its constants."""
        fields, count = list(vars(self).values())[1:], len(self.type.vectors + self.type.scalars)
        arguments = [field.components[0] if isinstance(field, Relative) else field for field in fields[:count]]
        return arguments, fields[count : count + len(self.type.data)]


def _elastic(f: Functions[N], x: N, k: N, L0: N | int = 0, **others: N) -> N:
    return k * (x - L0) ** 2 / 2


def _viscous(f: Functions[N], x: N, v: N, c: N, **others: N) -> N:
    return c * v


@dataclass(frozen=True, eq=False, kw_only=True)
class Spring(Load):
    """Spring and damper along a segment."""

    label: str
    segment: Combination
    stiffness: Value
    damping: Value
    free: Value
    law: sympy.Expr | None = None

    kind = ForceType(
        key="spring",
        vectors=("a",),
        scalars=(),
        data=("k", "c", "L0"),
        equation="k (|a| - L0)^2 / 2, damper c",
        potential=_elastic,
        friction=_viscous,
    )
    to_nothing = ForceType(
        key="spring-to-nothing",
        vectors=("a",),
        scalars=(),
        data=("k", "c"),
        equation="k |a|^2 / 2, damper c",
        potential=_elastic,
        friction=_viscous,
        regular=True,
    )

    @property
    def type(self) -> ForceType:
        return self.to_nothing if is_number(self.free) and self.free == 0.0 else self.kind


@dataclass(frozen=True, eq=False, kw_only=True)
class TorsionSpring(Load):
    """Spring and damper along a relative coordinate."""

    label: str
    coordinate: Relative
    stiffness: Value
    damping: Value
    free: Value
    law: sympy.Expr | None = None

    kind = ForceType(
        key="torsion-spring",
        vectors=(),
        scalars=("x",),
        data=("k", "c", "L0"),
        equation="k (x - x0)^2 / 2, damper c",
        potential=_elastic,
        friction=_viscous,
    )


def on_directions(f: Functions[N], x1: Triple[N], x2: Triple[N], x3: Triple[N], nx: N, ny: N, nz: N, V: N) -> list[tuple[N, ...]]:
    """½ n × xᵏ along direction k, with the reciprocal basis xᵏ; the power is n·ω with ω = ½ Σ xᵏ × ẋ_k (natural coordinates, 2.5)."""
    crossed = [cross((nx, ny, nz), cross(*pair)) for pair in ((x2, x3), (x3, x1), (x1, x2))]
    return [tuple(component / (V * 2) for component in triple) for triple in crossed]


def on_pair(f: Functions[N], x1: Triple[N], x2: Triple[N], nx: N, ny: N, nz: N, V: N) -> list[tuple[N, ...]]:
    """The same where the third direction is x1 × x2, whose force acts on x1 by x2 × f3, and on x2 by f3 × x1."""
    first, second, third = on_directions(f, x1, x2, cross(x1, x2), nx, ny, nz, V)
    return [tuple(a + b for a, b in zip(*pair, strict=True)) for pair in ((first, cross(x2, third)), (second, cross(third, x1)))]


def _in_plane(f: Functions[N], a: Triple[N], nz: N, LL: N) -> list[tuple[N, ...]]:
    """nz z × a / L² along a direction of length L in the plane; the power is nz ω with ω = (a × ȧ)·z / L²."""
    return [(a[1] * nz / LL * -1, a[0] * nz / LL, a[2] * 0)]


@dataclass(frozen=True, eq=False)
class BodyLoad(Load):
    """A load that one body bears."""

    label: str
    body: Body

    def turned_by(self) -> tuple[Sequence[Combination], Value]:
        """Directions of the body along which forces can make any couple, and their volume. Raises ModelError where there are none."""
        frame = self.body.frame
        if len(frame.directions) < 2:
            more = "give it another element" if self.body.rigid else "use m.force at its points: its rows are your own"
            raise ModelError(f"{self.label}: the body's elements cannot describe every rotation that a couple makes; {more}")
        x, y, *others = frame.given
        z = others[0] if others else measures.cross(x, y)
        return frame.directions, measures.dot(x, measures.cross(y, z))


@dataclass(frozen=True, eq=False)
class Couple(BodyLoad):
    """A couple (N m, global axes) on a body: on three directions with the volume V, on two with V = |x1 × x2|², or in the plane on one."""

    components: tuple[Scalar, Scalar, Scalar]

    kind = ForceType(
        key="couple",
        vectors=("x1", "x2", "x3"),
        scalars=(),
        data=("nx", "ny", "nz", "V"),
        equation="n x reciprocal basis / 2",
        forces=on_directions,
    )
    on_pair = ForceType(
        key="couple-on-pair",
        vectors=("x1", "x2"),
        scalars=(),
        data=("nx", "ny", "nz", "V"),
        equation="n x reciprocal basis / 2",
        forces=on_pair,
    )
    in_plane = ForceType(key="couple-in-plane", vectors=("a",), scalars=(), data=("nz", "LL"), equation="nz z x a / LL", forces=_in_plane)

    @property
    def type(self) -> ForceType:
        frame = self.body.frame
        return self.in_plane if frame.planar else self.on_pair if len(frame.directions) == 2 else self.kind

    def given(self) -> tuple[list[Combination | Component], list[Value]]:
        """As of every load; what varies stands among the constants, which `ncgen.symbolic.equations` tells apart."""
        directions, volume = self.turned_by()
        if self.type is self.in_plane:
            _, segment = directions
            return [segment], [self.components[2], measures.dot(segment.given, segment.given)]
        return [*directions], [*self.components, volume]


@dataclass(frozen=True, eq=False)
class Force:
    """Generalised force components: sympy expressions of t, coordinates, rates and parameters.

    components: pairs (coordinate, expression); N for points, N m for angles
    """

    label: str
    components: tuple[tuple[Component, Scalar], ...]


@dataclass(frozen=True, eq=False)
class Potential:
    """A potential energy (J) whose negative gradient is a generalised force."""

    label: str
    expression: Scalar


@dataclass(frozen=True)
class Rotor:
    """Inertia that goes with a relative coordinate."""

    coordinate: Relative
    inertia: Value


FORCE_TYPES = (Spring.kind, Spring.to_nothing, TorsionSpring.kind, Couple.kind, Couple.on_pair, Couple.in_plane)
"""The force types of the catalogue."""
