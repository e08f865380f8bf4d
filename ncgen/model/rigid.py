"""Rigid-body rows, chosen by themselves: what keeps the elements of a body together.

A body has an origin (its first point) and up to three base directions. A new element either becomes a base
direction (its length and its angles to the others stay constant), or is written as a combination of the base:
linear rows with no mirror image. A body in the plane has the plane's normal as its first direction and, by the
cross product with it, all it needs after one segment.

Lengths and angles that belong to elements shared with another body are not repeated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import arithmetic, measures
from ncgen.model import rows as row
from ncgen.model.elements import Combination, Constant, Point, Spatial, Vector, as_combination
from ncgen.model.rows import Owner, Row
from ncgen.model.values import Parameter, Scalar, as_number_if_constant, is_number, mentioned, vanishes

PREFERRED_SINE = 0.2
"""A direction at least this far (sine of the angle) from the plane or line of the base is taken in the order given."""

MIN_SINE = 1e-3
"""One nearer than PREFERRED_SINE is taken only if nothing better comes; one nearer than this counts as dependent."""

WEIGHT_ROUNDING = 1e-10
"""Weights below this are rounding of the user's numbers."""

ROUNDING = 1e-9
"""Points nearer to each other than this, over the model's extent, coincide but for the rounding of whoever wrote their numbers."""

NORMAL = Constant.of("z", (0.0, 0.0, 1.0))
"""The normal of the plane of planar bodies: a constant, no coordinate."""

Claims: TypeAlias = dict[tuple[str, ...], bool]
"""{names of elements in order: True} of lengths (one name, or the two of a segment) and angles that have a row."""


@dataclass(eq=False, kw_only=True)
class Frame:
    """The base of a body while its elements come in.

    close_points: points so near to the origin that they show no direction
    resting: of a body that is welded to the ground, how many of its directions have rows that say so; else None
    """

    owner: Owner
    origin: Point | None = None
    directions: list[Combination] = field(default_factory=list)
    planar: bool = False
    resting: int | None = None
    close_points: list[Point] = field(default_factory=list)

    @property
    def is_crossed(self) -> bool:
        """True if the third direction is the cross product of the first two."""
        return self.planar and len(self.directions) == 2

    def matrix(self) -> np.ndarray:
        """Base directions in the initial position as columns, (3, 0 … 3), the crossed one included."""
        columns = [d.initial for d in self.directions]
        if self.is_crossed:
            columns.append(arithmetic.cross(columns[0], columns[1]))
        return np.array(columns).reshape(-1, 3).T

    @property
    def given(self) -> list[tuple[Scalar, ...]]:
        """The same as vectors of values: numbers, or expressions of parameters."""
        columns = [d.given for d in self.directions]
        return [*columns, measures.cross(*columns)] if self.is_crossed else columns

    @property
    def is_parametric(self) -> bool:
        """True if a parameter has a say in the base."""
        return any(d.is_parametric for d in self.directions)


def include(
    frame: Frame, elements: list[Spatial], known: Claims, parameters: dict[str, Parameter], scaled: bool, extent: float
) -> list[Row]:
    """Rows that tie new elements to a body.

    known: which lengths and angles of the model have a row; extent: of the whole model (m). A point that is near to the body's origin
    near it tells no direction: it is written as a combination of the base.
    Raises ModelError where points coincide and nothing else shows a direction.
    """
    elements = sorted(elements, key=lambda e: not isinstance(e, Point))  # points first, otherwise as given
    if frame.origin is None:
        _start(frame, elements)
    waiting = [e for e in elements if e is not frame.origin]
    directions = {element: _direction(frame, element) for element in waiting}
    made: list[Row] = []
    for nearest in (measures.MIN_RELATIVE_LENGTH * extent, ROUNDING * extent):
        for least in (PREFERRED_SINE, MIN_SINE):
            for element in list(waiting):
                direction = directions[element]
                if len(frame.directions) + frame.is_crossed == 3 or not _shows_direction(direction, nearest):
                    continue
                if _distance_from_base(frame, direction) > least:
                    made += _base_rows(frame, element, direction, known, scaled)
                    frame.directions.append(direction)
                    waiting.remove(element)
    frame.close_points += [
        e for e in waiting if isinstance(e, Point) and not _shows_direction(directions[e], measures.MIN_RELATIVE_LENGTH * extent)
    ]
    for element in waiting:
        if len(frame.directions) == frame.planar and not arithmetic.norm(directions[element].initial) > 0:
            raise ModelError(f"{frame.owner}: the points {element.name} and {_origin(frame).name} coincide; share one point instead")
        made += _combined_rows(frame, element, parameters, extent)
    return [r.as_measured() for r in made if not row.is_trivial(r)]


def _shows_direction(direction: Combination, nearest: float) -> bool:
    """True of a vector, and of a segment that is longer than `nearest` (m)."""
    return measures.shape(direction) == "vector" or arithmetic.norm(direction.initial) > nearest


def _start(frame: Frame, elements: Sequence[Spatial]) -> None:
    frame.origin = next((e for e in elements if isinstance(e, Point)), None)
    frame.planar = all(_in_plane(e, frame.origin) for e in elements) and frame.origin is not None
    if frame.planar:
        frame.directions.append(as_combination(NORMAL))


def _in_plane(element: Spatial, origin: Point | None) -> bool:
    height = element.components[2]
    if isinstance(element, Vector):
        return height.fixed and height.value in (0.0, 1.0, -1.0)
    return height.fixed and origin is not None and height.value == origin.components[2].value


def _direction(frame: Frame, element: Spatial) -> Combination:
    if isinstance(element, Vector):
        return as_combination(element)
    return element - _origin(frame)


def _origin(frame: Frame) -> Point:
    """The origin of a frame that has points."""
    if frame.origin is None:
        raise ModelError(f"{frame.owner}: it has no point yet; give it one")
    return frame.origin


def _distance_from_base(frame: Frame, direction: Combination) -> float:
    """Sine of the angle between a direction and what the base spans, which is a line or a plane, or nothing yet."""
    base, unit = [arithmetic.unit(d.initial) for d in frame.directions], arithmetic.unit(direction.initial)
    if len(base) == 2:
        return abs(arithmetic.dot(arithmetic.unit(arithmetic.cross(*base)), unit))
    return arithmetic.norm(arithmetic.cross(base[0], unit)) if base else 1.0


def _base_rows(frame: Frame, element: Spatial, direction: Combination, known: Claims, scaled: bool) -> list[Row]:
    """Constant length, and constant angles to the base directions there are."""
    made: list[Row] = []
    if isinstance(element, Vector):
        if _claim(known, element):
            made.append(row.unit(element, frame.owner, scaled))
    elif isinstance(element, Point) and _claim(known, element, _origin(frame)):
        made.append(_distance_row(frame, _origin(frame), element, direction, scaled))
    for other in frame.directions:
        made += _angle_row(frame, direction, other, known, scaled)
    return made


def _distance_row(frame: Frame, start: Point, end: Point, segment: Combination, scaled: bool) -> Row:
    return row.distance(start, end, measures.length(segment), frame.owner, arithmetic.norm(segment.initial), scaled)


def _angle_row(frame: Frame, a: Combination, b: Combination, known: Claims, scaled: bool) -> list[Row]:
    vectors = [d for d in (a, b) if measures.shape(d) == "vector"]
    if not vectors:
        # Two segments from the origin: the distance between their ends says the same as their angle.
        first, second = _end(a), _end(b)
        if not _claim(known, first, second):
            return []
        return [_distance_row(frame, first, second, first - second, scaled)]
    if not _claim(known, *a.elements, *b.elements):
        return []
    cosine = measures.cosine(a, b)
    numeric = cosine if is_number(cosine) else measures.cosine_of(a.initial, b.initial)
    if len(vectors) == 2:
        return [row.vector_vector(a.elements[0], b.elements[0], cosine, frame.owner, numeric, scaled)]
    vector, segment = (a, b) if measures.shape(a) == "vector" else (b, a)
    return [row.vector_segment(vector.elements[0], segment, measures.length(segment), cosine, frame.owner, numeric, scaled)]


def _end(segment: Combination) -> Point:
    """Where a segment from the origin ends."""
    end = segment.elements[0]
    assert isinstance(end, Point), f"{segment} is no segment"
    return end


def _combined_rows(frame: Frame, element: Spatial, parameters: dict[str, Parameter], extent: float) -> list[Row]:
    """element = origin + Σ weight · direction, one linear row a component.

    What lies outside the plane of two directions, but too near to it to be a third one, takes their cross product besides.
    """
    direction = _direction(frame, element)
    size = measures.natural_length(direction, extent) if isinstance(element, Point) else 1.0
    parametric = frame.is_parametric or direction.is_parametric
    weights = _parametric_weights(frame, element, direction, size, parameters) if parametric else _weights(frame, direction, size)
    turned = weights.pop() if len(weights) > len(frame.directions) else 0.0
    e = direction
    for weight, other in zip(weights, frame.directions, strict=True):
        if weight != 0.0:
            e = e - other * weight
    a, b = (frame.directions[0], frame.directions[1]) if frame.is_crossed or turned != 0.0 else (e, e)
    along = direction if isinstance(element, Point) else None
    return row.affine(e, a, b, turned, along, frame.owner, f"combination {element.name}")


def _weights(frame: Frame, direction: Combination, size: float) -> list[float]:
    base = frame.matrix().T
    if len(base) == 2:
        base = np.vstack([base, arithmetic.cross(*base)])
    weights = arithmetic.weights(base, direction.initial)
    return [0.0 if abs(w) * arithmetic.norm(d) < WEIGHT_ROUNDING * size else w for w, d in zip(weights, base, strict=True)]


def _parametric_weights(
    frame: Frame, element: Spatial, direction: Combination, size: float, parameters: dict[str, Parameter]
) -> list[Scalar]:
    """Weights as expressions; refused where the element leaves what the base spans when parameters change."""
    base = frame.given
    weights = measures.weights(base, direction.given)
    weights = [
        0.0 if vanishes(w, parameters, float(WEIGHT_ROUNDING * size / np.linalg.norm(d))) else w
        for w, d in zip(weights, frame.matrix().T, strict=True)
    ]
    rest = [x - measures.dot(weights, [d[k] for d in base]) for k, x in enumerate(direction.given)]
    if len(base) < 3 and not all(vanishes(as_number_if_constant(x), parameters, MIN_SINE * size) for x in rest):
        names = mentioned([*direction.given, *(x for d in base for x in d)], parameters)
        raise ModelError(
            f"{frame.owner}: {element!r} lies on the line or in the plane of the body's other elements only at the default of {names}; "
            "choose a default outside this special position"
        )
    return weights


def _claim(known: Claims, *elements: Spatial) -> bool:
    """True the first time these elements are named together."""
    key = tuple(sorted({e.name for e in elements}))
    if key in known:
        return False
    known[key] = True
    return True
