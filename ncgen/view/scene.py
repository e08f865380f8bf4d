"""The scene: what a picture of a mechanism needs, and nothing of how it is drawn.

Natural coordinates are a drawing already: points, lines between them, and unit vectors at them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from ncgen.errors import NcgenError, shown
from ncgen.model import Model
from ncgen.model.elements import Combination, Point, Vector
from ncgen.view.carriers import Carrier, vectors_of
from ncgen.view.surfaces import StrutSurface, Surface, bodies_drawn, carriers_of, surfaces_of

if TYPE_CHECKING:
    from ncgen.solver.trajectories.trajectory import Trajectory

ARROW = 0.15
"""The drawn length of a unit vector, as a part of the scene's size."""

PLANE_TOLERANCE = 1e-9
"""How much z may vary in a planar scene, as a part of the scene's size."""


@dataclass(frozen=True, eq=False)
class Arrow:
    """A unit vector drawn at a point.

    point: index of the point
    direction: shape (K, 3)
    name: the vector's name
    """

    point: int
    direction: np.ndarray
    name: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """A mechanism at K times.

    t: times (s), shape (K,)
    points: the names of P points
    positions: of the points (m), shape (K, P, 3)
    fixed: which points cannot move, shape (P,)
    segments, springs: pairs of point indices
    arrows: the unit vectors, each at its point
    bodies: the names of the bodies that have points, with the indices of these
    surfaces, struts: shapes; carriers: of the bodies that have some
    axes, origins: of the carriers' frames, shapes (K, C, 3, 3) and (K, C, 3)
    directions: {name: (K, 3)} of the vectors that carriers need
    """

    name: str
    t: np.ndarray
    points: tuple[str, ...]
    positions: np.ndarray
    fixed: np.ndarray
    segments: tuple[tuple[int, int], ...]
    springs: tuple[tuple[int, int], ...]
    arrows: tuple[Arrow, ...]
    bodies: tuple[tuple[str, tuple[int, ...]], ...] = ()
    surfaces: tuple[Surface, ...] = ()
    struts: tuple[StrutSurface, ...] = ()
    carriers: tuple[Carrier, ...] = ()
    axes: np.ndarray = field(default_factory=lambda: np.zeros((1, 0, 3, 3)))
    origins: np.ndarray = field(default_factory=lambda: np.zeros((1, 0, 3)))
    directions: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def vectors(self) -> list[str]:
        """The names of the vectors that are drawn, each once."""
        return list(dict.fromkeys(arrow.name for arrow in self.arrows))

    @property
    def moving(self) -> list[str]:
        """The names of the vectors whose directions a moving picture needs: those that are drawn, and those that carry shapes."""
        return list(dict.fromkeys([*self.vectors, *self.directions]))

    @property
    def has_shapes(self) -> bool:
        return bool(self.surfaces or self.struts)

    @cached_property
    def bounds(self) -> np.ndarray:
        """Lowest and highest coordinates of all points and shapes at all times (m), shape (2, 3)."""
        points = [self.positions.reshape(-1, 3), *(self._reach(surface).reshape(-1, 3) for surface in self.surfaces)]
        return np.array([np.min([e.min(axis=0) for e in points], axis=0), np.max([e.max(axis=0) for e in points], axis=0)])

    def _reach(self, surface: Surface) -> np.ndarray:
        """What a shape reaches to (K, R, 3)."""
        k = surface.carrier
        return surface.reach @ self.axes[:, k].transpose(0, 2, 1) + self.origins[:, k, None]

    @property
    def size(self) -> float:
        """The longest side of the bounds (m); 1 where all points are one."""
        low, high = self.bounds
        return float((high - low).max()) or 1.0

    @property
    def arrow_length(self) -> float:
        """The length (m) at which a unit vector is drawn."""
        return ARROW * self.size

    @property
    def planar(self) -> bool:
        """True if all points have the same z at all times, whatever the shapes."""
        return bool(np.ptp(self.positions[..., 2]) <= PLANE_TOLERANCE * self.size)

    def at(self, frames: np.ndarray) -> Scene:
        """The scene at some of its times only; `frames` are indices, shape (F,)."""
        arrows = tuple(Arrow(arrow.point, arrow.direction[frames], arrow.name) for arrow in self.arrows)
        return replace(
            self,
            t=self.t[frames],
            positions=self.positions[frames],
            arrows=arrows,
            axes=self.axes[frames],
            origins=self.origins[frames],
            directions={name: history[frames] for name, history in self.directions.items()},
        )


def scene_of(model_or_run: Model | Trajectory) -> Scene:
    """The scene of a model (its initial position, K = 1) or of a trajectory.

    Raises NcgenError where there is no point to draw or a position is not a finite number.
    """
    if not hasattr(model_or_run, "t") and not isinstance(model_or_run, Model):
        raise NcgenError(f"{shown(model_or_run)} given; a picture shows a model, or a trajectory that ncgen.simulate makes")
    model, run = (model_or_run, None) if isinstance(model_or_run, Model) else (model_or_run.model, model_or_run)
    t = np.zeros(1) if run is None else np.asarray(run.t, dtype=float)
    points = [element for element in model.elements.values() if isinstance(element, Point)]
    if not points:
        raise NcgenError(f"{model_or_run.name}: there is no point to draw; give the model one")

    def history(element: Point | Vector) -> np.ndarray:
        values = element.initial[None] if run is None else _of_run(run, element)
        return _finite(values, model_or_run.name, element, t)

    index = {point: i for i, point in enumerate(points)}
    histories = {point: history(point) for point in points}
    return Scene(
        name=model_or_run.name,
        t=t,
        points=tuple(point.name for point in points),
        positions=np.stack(list(histories.values()), axis=1),
        fixed=np.array([point.fixed for point in points]),
        segments=tuple((index[start], index[end]) for start, end in lines(model)),
        springs=tuple((index[start], index[end]) for start, end in springs(model)),
        arrows=tuple(Arrow(index[point], history(vector), vector.name) for point, vector in arrows(model)),
        bodies=tuple((body.name, tuple(index[point] for point in body.points)) for body in bodies_drawn(model)),
        **_shapes(model, index, histories, history, len(t)),
    )


def _shapes(
    model: Model, index: Mapping[Point, int], histories: Mapping[Point, np.ndarray], history: Callable[[Vector], np.ndarray], count: int
) -> dict[str, Any]:
    """The part of a scene that is shapes, by the names of its fields."""
    carriers = carriers_of(model)
    needed = {vector: history(vector) for body, carrier in carriers for vector in vectors_of(carrier, body)}
    directions = {vector.name: values for vector, values in needed.items()}
    start = {point: point.initial[None] for point in histories}, {vector.name: vector.initial[None] for vector in needed}
    begins = [(body, carrier.placed(*start, 1)) for body, carrier in carriers]
    frames = [carrier.placed(histories, directions, count) for _, carrier in carriers]
    return {
        "surfaces": surfaces_of(model, {body: (k, axes[0], origin[0]) for k, (body, (axes, origin)) in enumerate(begins)}),
        "struts": tuple(_struts(model, index)),
        "carriers": tuple(carrier for _, carrier in carriers),
        "axes": np.stack([axes for axes, _ in frames], axis=1) if frames else np.zeros((count, 0, 3, 3)),
        "origins": np.stack([origin for _, origin in frames], axis=1) if frames else np.zeros((count, 0, 3)),
        "directions": directions,
    }


def _struts(model: Model, index: Mapping[Point, int]) -> Iterator[StrutSurface]:
    """A bar has the colour of the body that it is a part of, and what is longer or shorter that of the ground."""
    bodies = bodies_drawn(model)
    for strut in model.drawing.struts:
        owner = next((k for k, body in enumerate(bodies) if strut.start in body.points and strut.end in body.points), -1)
        yield StrutSurface(
            start=index[strut.start], end=index[strut.end], radius=strut.radius, length=strut.length, colour=strut.colour or owner
        )


def lines(model: Model) -> list[tuple[Point, Point]]:
    """The lines the model asks for; else one between every two points of each body and along each constant distance."""
    if model.drawing.lines:
        return model.drawing.lines
    pairs = [pair for body in model.bodies.values() for pair in combinations(body.points, 2)]
    for row in model.rows:
        if row.code == 1000 and isinstance(along := row.arguments["a"], Combination):
            start, end = (element for element in along.elements if isinstance(element, Point))
            pairs.append((start, end))
    return list({frozenset(pair): pair for pair in pairs}.values())


def springs(model: Model) -> list[tuple[Point, Point]]:
    """The ends of every force of the catalogue that pulls between two points, where the model asks for no lines, or has shapes.

    A strut in the same place stands for it.
    """
    if model.drawing.lines and not model.drawing.has_shapes:
        return []
    struts = {frozenset((strut.start, strut.end)) for strut in model.drawing.struts}
    combinations = [argument.elements for load in model.springs for argument in load.given()[0] if isinstance(argument, Combination)]
    ends = [tuple(element for element in elements if isinstance(element, Point)) for elements in combinations]
    return [pair for pair in ends if len(pair) == 2 and frozenset(pair) not in struts]


def arrows(model: Model) -> list[tuple[Point, Vector]]:
    """The arrows the model asks for; where it asks for no drawing at all, each body's vectors at its first point.

    Auxiliary vectors, whose names the model chose (`link.aux`), are not among the latter.
    """
    if model.drawing.arrows or model.drawing.lines:
        return model.drawing.arrows
    bodies = [body for body in model.bodies.values() if body.points]
    pairs = [(body.points[0], vector) for body in bodies for vector in body.vectors if not vector.name.startswith(f"{body.name}.")]
    return list(dict.fromkeys(pairs))


def _of_run(run: Trajectory, element: Point | Vector) -> np.ndarray:
    values = run.point(element.name) if isinstance(element, Point) else run.vector(element.name)
    return np.asarray(values, dtype=float)


def _finite(values: np.ndarray, name: str, element: Point | Vector, t: np.ndarray) -> np.ndarray:
    bad = ~np.isfinite(values).all(axis=1)
    if bad.any():
        when = t[bad.argmax()]
        raise NcgenError(f"{name}: {element!r} at t = {when:g} s is not a finite number; draw the run up to there")
    return values
