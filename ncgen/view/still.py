"""The shapes of a scene at one time, as coloured triangles: what a still picture of solids needs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache

import numpy as np

from ncgen.resources import folder
from ncgen.view.eye import LIGHT_DIRECTION
from ncgen.view.scene import Scene
from ncgen.view.triangles import Mesh, cylinder, spring

MAX_SIDE_FRACTION = 1 / 20
"""The longest side of a triangle over the scene's size, so that triangles can be told which is in front by their middles."""

COIL, WIRE = 0.02, 0.22
"""Radius of a spring over the scene's size, and of its wire over that."""

ROD = 0.55
"""Radius of a telescope's rod over that of its barrel."""

STEEL = -1
"""The number that stands for no body's colour."""


def solids(scene: Scene, frame: int, towards: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (N, 3, 3) (m), and their colours (N, 3) from 0 to 1 in the light as seen from a direction (3,)."""
    meshes = [
        (_divided(mesh.vertices[mesh.triangles], MAX_SIDE_FRACTION * scene.size), _rgb(colour)) for mesh, colour in _meshes(scene, frame)
    ]
    if not meshes:
        return np.zeros((0, 3, 3)), np.zeros((0, 3))
    triangles = np.concatenate([t for t, _ in meshes])
    colours = np.concatenate([np.tile(rgb, (len(t), 1)) for t, rgb in meshes])
    return triangles, np.clip(colours * _shade(triangles, towards)[:, None], 0, 1)


def shadows(triangles: np.ndarray, floor: float) -> np.ndarray:
    """Where triangles hide the light from a level plane (N, 3, 3)."""
    fallen = triangles.copy()
    fallen[..., :2] -= (triangles[..., 2:] - floor) * LIGHT_DIRECTION[:2] / LIGHT_DIRECTION[2]
    fallen[..., 2] = floor
    return fallen


def _meshes(scene: Scene, frame: int) -> Iterator[tuple[Mesh, str | int]]:
    """All shapes in the global frame."""
    for surface in scene.surfaces:
        yield surface.placed.moved(scene.axes[frame, surface.carrier], scene.origins[frame, surface.carrier]), surface.colour
    positions = scene.positions[frame]
    for strut in scene.struts:
        start, end = positions[strut.start], positions[strut.end]
        yield _between(cylinder(1, 0, 1), start, end, strut.radius, strut.length), strut.colour
        if strut.length is not None:
            yield _between(cylinder(1, 0, 1), start, end, ROD * strut.radius), strut.colour
    for a, b in scene.springs:
        yield _between(spring(), positions[a], positions[b], COIL * scene.size), STEEL


def _between(mesh: Mesh, start: np.ndarray, end: np.ndarray, radius: float, length: float | None = None) -> Mesh:
    """What reaches along z from 0 to 1, from a point to another one, or only so far."""
    distance = float(np.linalg.norm(end - start))
    along = (end - start) / (distance or 1.0)
    across = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    across /= np.linalg.norm(across) or 1.0
    axes = np.column_stack([across, np.cross(along, across), along])
    placed = mesh.moved(axes * [radius, radius, min(length or distance, distance)], start)
    return placed if mesh.normals is None else Mesh(placed.vertices + WIRE * radius * mesh.normals @ axes.T, placed.triangles)


def _divided(triangles: np.ndarray, longest: float) -> np.ndarray:
    """Triangles (N, 3, 3) halved at their longest sides until none is longer."""
    done = []
    while len(triangles):
        sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        worst, rows = sides.argmax(axis=1), np.arange(len(triangles))
        long = sides[rows, worst] > longest
        done.append(triangles[~long])
        a, b, c = (triangles[rows, (worst + k) % 3][long] for k in range(3))
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done)


def _shade(triangles: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """How bright triangles are (N,), as in templates/html/solids.js.jinja; each has two sides."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(lengths > 0, lengths, 1.0)
    facing = normals @ towards
    normals = np.where(facing[:, None] < 0, -normals, normals)
    return 0.5 + 0.14 * normals[:, 2] + 0.46 * np.maximum(normals @ LIGHT_DIRECTION, 0) - 0.28 * (1 - np.abs(facing)) ** 3


def _rgb(colour: str | int) -> np.ndarray:
    text = colour if isinstance(colour, str) else palette()["steel" if colour == STEEL else f"body{colour % 8}"]
    return np.array([int(text[k : k + 2], 16) for k in (1, 3, 5)]) / 255


@cache
def palette() -> dict[str, str]:
    """The colours of light pages, by their names in the style sheet of moving pages."""
    text = (folder("templates") / "html" / "style.css.jinja").read_text(encoding="utf-8").partition("@media")[0]
    return dict(re.findall(r"--(\w+): (#[0-9a-f]{6});", text))
