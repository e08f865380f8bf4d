"""The shapes of a model as triangles, each in the frame of what carries it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ncgen.model import Model
from ncgen.model.bodies import Body
from ncgen.model.drawing import Drawing
from ncgen.model.shapes import Solid
from ncgen.view import triangles
from ncgen.view.carriers import Carrier, carrier_of
from ncgen.view.meshes import mesh_of
from ncgen.view.triangles import Mesh

UNITS = {"box": triangles.box(), "cylinder": triangles.cylinder(), "ellipsoid": triangles.ball()}
"""Meshes that sizes stretch."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Surface:
    """A shape: matrix @ vertex + shift is a vertex in the frame of carrier number `carrier`.

    colour: #rrggbb, or the number of a body whose colour it has; -1 for the ground's
    """

    carrier: int
    mesh: Mesh
    matrix: np.ndarray
    shift: np.ndarray
    colour: str | int

    @property
    def placed(self) -> Mesh:
        """In the carrier's frame."""
        return self.mesh.moved(self.matrix, self.shift)

    @property
    def reach(self) -> np.ndarray:
        """What it reaches to in the carrier's frame (R, 3)."""
        return self.mesh.reach @ self.matrix.T + self.shift


@dataclass(frozen=True, kw_only=True)
class StrutSurface:
    """A round bar between two points, by their indices; length: of the barrel of a telescope (m), else None; colour: as of a surface."""

    start: int
    end: int
    radius: float
    length: float | None
    colour: str | int


def carriers_of(model: Model) -> list[tuple[Body, Carrier]]:
    """The bodies that have shapes, and how they carry them."""
    bodies = dict.fromkeys(solid.body for solid in model.drawing.solids)
    numbers = {body: k for k, body in enumerate(bodies_drawn(model))}
    return [(body, carrier_of(body, numbers.get(body))) for body in bodies]


def bodies_drawn(model: Model) -> list[Body]:
    """The bodies that have points, in the order of their numbers and colours."""
    return [body for body in model.bodies.values() if body.points]


def surfaces_of(model: Model, carriers: Mapping[Body, tuple[int, np.ndarray, np.ndarray]]) -> tuple[Surface, ...]:
    """All shapes that can be shown. carriers: {body: (number, axes (3, 3), origin (3,)) of its frame in the initial position}"""
    numbers = {body: k for k, body in enumerate(bodies_drawn(model))}
    return tuple(_surfaces(model.drawing, carriers, numbers))


def _surfaces(
    drawing: Drawing, carriers: Mapping[Body, tuple[int, np.ndarray, np.ndarray]], numbers: Mapping[Body, int]
) -> Iterator[Surface]:
    for solid in drawing.solids:
        mesh = _mesh(solid, drawing.folder)
        if mesh is None:
            continue
        number, axes, origin = carriers[solid.body]
        stretch = _stretch(solid)
        matrix, shift = axes.T @ solid.rotation * stretch, axes.T @ (solid.position - origin)
        yield Surface(carrier=number, mesh=mesh, matrix=matrix, shift=shift, colour=solid.colour or numbers.get(solid.body, -1))


def _mesh(solid: Solid, folder: Path | None) -> Mesh | None:
    """About the shape's own frame, as far as its sizes do not stretch it."""
    match solid.kind:
        case "capsule":
            return triangles.capsule(*solid.sizes)
        case "wheel":
            return triangles.wheel(*solid.sizes)
        case "polygon":
            assert solid.corners is not None, "a polygon without corners"
            return triangles.polygon(((solid.corners - solid.position) @ solid.rotation)[:, :2], *solid.sizes)
        case "mesh":
            return mesh_of((folder or Path()) / solid.file)
    return UNITS[solid.kind]


def _stretch(solid: Solid) -> np.ndarray:
    """Factors along the axes of the shape's frame."""
    if solid.kind == "cylinder":
        radius, length = solid.sizes
        return np.array([radius, radius, length])
    return np.array(solid.sizes) if solid.kind in ("box", "ellipsoid", "mesh") else np.ones(3)
