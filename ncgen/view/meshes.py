"""Meshes from files, read by trimesh (`pip install 'ncgen[robots]'`), and brought to as few triangles as a picture needs.

A file is data: its size is limited, XML with document types or entities is refused, and what it names in addition to itself, such as
textures,
is not opened. What cannot be read is reported in one line, and the picture goes without it.
"""

from __future__ import annotations

import logging
import re
import warnings
from functools import lru_cache
from importlib import import_module
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ncgen.files import contents, is_file
from ncgen.view.triangles import Mesh

MAX_FILE_BYTES = 50_000_000
"""Bytes of a file."""

MAX_TRIANGLES = 400
"""Triangles that are kept of a mesh."""

MAX_COORDINATE = 1e9
"""Coordinates of corners (m) beyond which a file has lost its unit, or its numbers."""

MIN_RELATIVE_AREA = 1e-12
"""Triangles of less area than this, over the square of the mesh's extent, have none."""

KINDS = (".stl", ".obj", ".dae")

FORBIDDEN = (b"<!DOCTYPE", b"<!ENTITY")

UNIT = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)")
"""Where a DAE file says how long its unit is (m)."""

DAMPED = 1e-3
"""How much a corner is held to the middle of those that it stands for, over what its planes say."""


class Unreadable(Exception):
    """A mesh that cannot be shown: why, in a few words."""


def mesh_of(path: Path) -> Mesh | None:
    """The triangles of a file, MAX_TRIANGLES at most; None where there are none to show, which is reported in one line."""
    try:
        stat = path.stat()
        return _read(path, stat.st_mtime_ns, stat.st_size)
    except (OSError, ValueError):
        problem = "there is no such file"
    except Unreadable as error:
        problem = str(error)
    warnings.warn(f"mesh {path}: {problem}; it is left out of the picture", stacklevel=2)
    return None


@lru_cache(maxsize=256)
def _read(path: Path, changed: int, size: int) -> Mesh:
    return simplified(whole(path))


def whole(path: Path) -> Mesh:
    """All triangles of a file. Raises Unreadable."""
    if path.suffix.lower() not in KINDS:
        raise Unreadable(f"files of meshes end with {', '.join(KINDS)}")
    if not is_file(path):
        raise Unreadable("it is no ordinary file")
    if (size := path.stat().st_size) > MAX_FILE_BYTES:
        raise Unreadable(f"it has {size} bytes, and {MAX_FILE_BYTES} are read")
    data = contents(path, MAX_FILE_BYTES)
    kind = path.suffix.lower()[1:]
    if kind == "dae" and any(word in data for word in FORBIDDEN):
        raise Unreadable("document types and entities are not read")
    mesh = _parsed(data, kind)
    unit = UNIT.search(data) if kind == "dae" else None
    mesh = Mesh(mesh.vertices * float(unit[1]), mesh.triangles) if unit else mesh
    _check(mesh)
    return mesh


def _parsed(data: bytes, kind: str) -> Mesh:
    try:
        trimesh: Any = import_module("trimesh")
    except ImportError:
        raise Unreadable("trimesh, which reads it, is missing: pip install 'ncgen[robots]'") from None
    if kind == "dae" and find_spec("collada") is None:
        raise Unreadable("pycollada, which reads DAE, is missing: pip install 'ncgen[robots]'")
    logger = logging.getLogger("trimesh.util")  # it logs tracebacks
    quiet, logger.disabled = logger.disabled, True
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            loaded = trimesh.load(BytesIO(data), file_type=kind, force="mesh", process=False, skip_materials=True)
        vertices, triangles = np.asarray(loaded.vertices, dtype=float), np.asarray(loaded.faces, dtype=np.int64)
    except Exception as error:  # a parser of others fails in its own ways on what is no mesh
        raise Unreadable(f"it cannot be read ({type(error).__name__})") from None
    finally:
        logger.disabled = quiet
    if not len(triangles) or not np.isfinite(vertices).all():
        raise Unreadable("it has no triangles" if not len(triangles) else "it has numbers that are not finite")
    return Mesh(vertices, triangles)


def _check(mesh: Mesh) -> None:
    """Raise Unreadable where no triangle has an area, or a corner is beyond all sense."""
    if not (most := float(np.max(np.abs(mesh.vertices)))) <= MAX_COORDINATE:
        raise Unreadable(f"it has a corner at {most:.3g} m, and {MAX_COORDINATE:.0e} are shown; correct its unit")
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    if not (area > MIN_RELATIVE_AREA * np.ptp(mesh.vertices, axis=0).max() ** 2).any():
        raise Unreadable("no triangle in it has an area")


def simplified(mesh: Mesh, most: int = MAX_TRIANGLES) -> Mesh:
    """The mesh with `most` triangles at most: vertices in a cell of a grid become one, where the planes that meet there say.

    The grid is the finest that leaves no more triangles than that. Each cell's vertex minimises the squared distances to the planes of
    its triangles (Lindstrom 2000), within the cell.
    """
    vertices, triangles = _welded(mesh)
    if len(triangles) <= most:
        return Mesh(vertices, triangles)
    coarse, fine = 1, 256
    while fine - coarse > 1:
        cells = (coarse + fine) // 2
        coarse, fine = (cells, fine) if len(_clustered(vertices, triangles, cells)[1]) <= most else (coarse, cells)
    return Mesh(*_merged(vertices, triangles, coarse))


def _welded(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Vertices at the same place as one; triangles without area in this sense left out."""
    positions, owner = np.unique(mesh.vertices, axis=0, return_inverse=True)
    triangles = owner.reshape(-1)[mesh.triangles]
    distinct = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return positions, triangles[distinct]


def _cells(vertices: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, float]:
    """The cell of every vertex as one number, the lowest corner of the grid, and the cells' width: `count` along the longest side."""
    low = vertices.min(axis=0)
    width = float(np.ptp(vertices, axis=0).max()) / count or 1.0
    cell = np.minimum((vertices - low) // width, count).astype(np.int64)
    return cell @ np.array([1, count + 1, (count + 1) ** 2]), low, width


def _clustered(vertices: np.ndarray, triangles: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The cluster of every vertex, and the triangles between different clusters, each once."""
    _, owner = np.unique(_cells(vertices, count)[0], return_inverse=True)
    owner = owner.reshape(-1)
    clusters = owner[triangles]
    clusters = clusters[(clusters != np.roll(clusters, 1, axis=1)).all(axis=1)]
    _, first = np.unique(np.sort(clusters, axis=1), axis=0, return_index=True)
    return owner, clusters[np.sort(first)]


def _merged(vertices: np.ndarray, triangles: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """A vertex for every cluster that a triangle is left of."""
    owner, kept = _clustered(vertices, triangles, count)
    clusters = owner.max() + 1
    numbers = np.bincount(owner, minlength=clusters)[:, None]
    middle = np.zeros((clusters, 3))
    np.add.at(middle, owner, vertices)
    middle /= numbers
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)  # of length twice the area, so that large triangles count more
    quadric, moment = np.zeros((clusters, 3, 3)), np.zeros((clusters, 3))
    for k in range(3):
        clusters_of = owner[triangles[:, k]]
        np.add.at(quadric, clusters_of, normal[:, :, None] * normal[:, None, :])
        np.add.at(moment, clusters_of, normal * (normal * (a - middle[clusters_of])).sum(axis=1, keepdims=True))
    held = DAMPED * np.trace(quadric, axis1=1, axis2=2) + 1e-300
    step = np.linalg.solve(quadric + held[:, None, None] * np.eye(3), moment[..., None])[..., 0]
    width = _cells(vertices, count)[2]
    positions = middle + np.clip(step, -width / 2, width / 2)
    used, number = np.unique(kept, return_inverse=True)
    return positions[used], number.reshape(-1, 3)
