"""Shapes as triangles: boxes, cylinders, wheels, polygons, springs, whatever a picture shows of a body."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

SIDES = 24
"""Of what is round."""

WINDINGS, STEPS, WIRE = 8, 12, 6
"""Of a spring: turns, parts of a turn, and sides of its wire."""

SPOKES = 5

DIRECTIONS_AROUND = np.array([way for way in np.ndindex(3, 3, 3) if way != (1, 1, 1)]) - 1.0
"""Along edges, diagonals of sides and diagonals of a cube."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """vertices (V, 3) (m), triangles (T, 3) of indices

    normals (V, 3): of a spring, whose vertices are the middle of its wire; the wire's surface is its radius along them
    """

    vertices: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray | None = None

    def moved(self, matrix: np.ndarray, position: np.ndarray) -> Mesh:
        """With vertices matrix @ v + position."""
        return Mesh(self.vertices @ matrix.T + position, self.triangles)

    @property
    def reach(self) -> np.ndarray:
        """The vertices that are farthest along 26 directions (R, 3): all corners of a box, and of what is round nearly all that matters."""
        return self.vertices[np.unique((self.vertices @ DIRECTIONS_AROUND.T).argmax(axis=0))]


def together(meshes: Iterable[Mesh]) -> Mesh:
    """Several as one."""
    meshes = list(meshes)
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts)])
    )


def box(sizes: Iterable[float] = (1, 1, 1)) -> Mesh:
    """About the origin, with these sides."""
    corners = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]) * np.array(tuple(sizes))
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return Mesh(corners, np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]))


def turned(profile: Iterable[tuple[float, float]], sides: int = SIDES) -> Mesh:
    """A surface of revolution about z. profile: (radius, height), from one end to the other; radius 0 closes it in one vertex."""
    rings: list[np.ndarray] = []
    vertices: list[tuple[float, float, float]] = []
    for radius, height in profile:
        count = sides if radius > 0 else 1
        rings.append(np.resize(np.arange(len(vertices), len(vertices) + count), sides))
        angles = (2 * math.pi * k / sides for k in range(count))
        vertices += [(radius * math.cos(a), radius * math.sin(a), height) for a in angles]
    triangles = []
    for below, above in zip(rings, rings[1:]):
        for a, b, c, d in zip(below, np.roll(below, -1), np.roll(above, -1), above):
            triangles += [t for t in ((a, b, c), (a, c, d)) if len(set(t)) == 3]
    return Mesh(np.array(vertices), np.array(triangles))


def cylinder(radius: float = 1.0, low: float = -0.5, high: float = 0.5) -> Mesh:
    """About z from one height to another."""
    return turned([(0, low), (radius, low), (radius, high), (0, high)])


def ball() -> Mesh:
    """Of radius 1 about the origin."""
    return turned(_arc(-math.pi / 2, math.pi / 2, 0.0, 12))


def capsule(radius: float, length: float) -> Mesh:
    """About z, with the middles of its ends `length` apart."""
    ends = [(-math.pi / 2, 0.0, -length / 2), (0.0, math.pi / 2, length / 2)]
    return turned([(radius * r, radius * (h - middle) + middle) for a, b, middle in ends for r, h in _arc(a, b, middle, 5)])


def _arc(start: float, end: float, middle: float, steps: int) -> list[tuple[float, float]]:
    """Of a circle of radius 1: (radius, height) from one angle to another, about a height."""
    angles = [start + (end - start) * k / steps for k in range(steps + 1)]
    return [(0.0 if abs(math.cos(a)) < 1e-9 else math.cos(a), middle + math.sin(a)) for a in angles]


def wheel(radius: float, width: float) -> Mesh:
    """About z: a tyre, a hub and spokes, one of them broader, so that turns can be counted."""
    half, inner, hub = width / 2, 0.8 * radius, 0.2 * radius
    tyre = turned(
        [
            (inner, -half),
            (0.96 * radius, -half),
            (radius, -0.7 * half),
            (radius, 0.7 * half),
            (0.96 * radius, half),
            (inner, half),
            (inner, -half),
        ],
        36,
    )
    parts = [tyre, cylinder(hub, -half, half)]
    for k in range(SPOKES):
        angle, thick = 2 * math.pi * k / SPOKES, (0.2 if k == 0 else 0.1) * radius
        c, s = math.cos(angle), math.sin(angle)
        spoke = box((inner, thick, 0.5 * width)).moved(np.eye(3), np.array([inner / 2, 0, 0]))
        parts.append(spoke.moved(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.zeros(3)))
    return together(parts)


def polygon(corners: np.ndarray, thickness: float) -> Mesh:
    """In the plane z = 0, with half of the thickness to either side. corners: (N, 2), in order around it; it need not be convex."""
    around = np.roll(corners, -1, axis=0)
    if (corners[:, 0] * around[:, 1] - corners[:, 1] * around[:, 0]).sum() < 0:
        corners = corners[::-1]
    count, cut = len(corners), _ears(corners)
    if thickness == 0:
        return Mesh(np.column_stack([corners, np.zeros(count)]), cut)
    vertices = np.concatenate([np.column_stack([corners, np.full(count, side * thickness / 2)]) for side in (-1, 1)])
    edges = [(k, (k + 1) % count) for k in range(count)]
    sides = [t for a, b in edges for t in ((a, b, b + count), (a, b + count, a + count))]
    return Mesh(vertices, np.concatenate([cut[:, ::-1], cut + count, np.array(sides)]))


def _ears(corners: np.ndarray) -> np.ndarray:
    """A polygon, counterclockwise, cut into such triangles, one corner after the other (Meisters 1975)."""

    def area(a: int, b: int, c: int) -> float:
        (ax, ay), (bx, by), (cx, cy) = corners[a], corners[b], corners[c]
        return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)

    left = list(range(len(corners)))
    ears = []
    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            others = (p for p in left if p not in (a, b, c))
            if area(a, b, c) > 0 and not any(area(a, b, p) >= 0 and area(b, c, p) >= 0 and area(c, a, p) >= 0 for p in others):
                break
        else:
            k, a, b, c = 0, left[-1], left[0], left[1]  # crossing sides: any triangle is as good
        ears.append((a, b, c))
        del left[k]
    return np.array([*ears, tuple(left)])


def spring() -> Mesh:
    """Of length 1 along z from the origin and radius 1, with straight ends on its axis; its wire has no thickness but its normals."""
    turns = np.linspace(0, 2 * math.pi * WINDINGS, WINDINGS * STEPS + 1)
    coil = np.column_stack([np.cos(turns), np.sin(turns), 0.12 + 0.76 * turns / turns[-1]])
    line = np.concatenate([[[0, 0, 0], [0, 0, 0.12]], coil, [[0, 0, 0.88], [0, 0, 1]]])
    along = np.gradient(line * [0.2, 0.2, 1], axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    outward = line * [1, 1, 0] + [1e-3, 0, 0]
    outward -= (outward * along).sum(axis=1, keepdims=True) * along
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    across = np.cross(along, outward)
    angles = 2 * math.pi * np.arange(WIRE) / WIRE
    normals = (np.cos(angles)[:, None, None] * outward + np.sin(angles)[:, None, None] * across).transpose(1, 0, 2).reshape(-1, 3)
    rings = np.arange(len(line) * WIRE).reshape(-1, WIRE)
    a, b, c, d = (rings[:-1], np.roll(rings[:-1], -1, axis=1), np.roll(rings[1:], -1, axis=1), rings[1:])
    triangles = np.concatenate([np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)])
    return Mesh(np.repeat(line, WIRE, axis=0), triangles, normals)
