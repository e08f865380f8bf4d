"""What links look like in a file, and the shapes of a model that they become.

Meshes are names here: nothing opens them before a picture is made. Addresses are resolved on this machine alone, and nothing is fetched.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.robots.placement import Placement
from ncgen.files import is_file
from ncgen.model import Model
from ncgen.model.bodies import Body

PACKAGES = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "SDF_PATH")
"""Variables of the environment that name folders with packages and models, as ROS and Gazebo use them."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Shape:
    """A shape in the frame of a link, with the words of `ncgen.model.shapes.Solid`; file: an absolute path."""

    kind: str
    sizes: tuple[float, ...]
    placement: Placement
    colour: str | None = None
    file: str = ""

    def seen_from(self, frame: Placement) -> Shape:
        """The same, where its own frame stands in another one like this."""
        return replace(self, placement=frame @ self.placement)

    def show(self, model: Model, body: Body) -> None:
        """On a body of a model. The shape must be told in the global frame."""
        position, sizes = self.placement.position.tolist(), self.sizes
        turn, axis = self.placement.rpy, self.placement.rotation[:, 2].tolist()
        match self.kind:
            case "box":
                model.box(body, sizes, position, turn, colour=self.colour)
            case "cylinder":
                model.cylinder(body, sizes[0], sizes[1], position, axis, colour=self.colour)
            case "capsule":
                model.capsule(body, sizes[0], sizes[1], position, axis, colour=self.colour)
            case "sphere":
                model.sphere(body, sizes[0], position, colour=self.colour)
            case "ellipsoid":
                model.ellipsoid(body, sizes, position, turn, colour=self.colour)
            case "mesh":
                model.mesh(body, self.file, position, turn, sizes, colour=self.colour)


@dataclass(frozen=True)
class Unseen:
    """What is not shown: a kind of geometry, or the name of a mesh whose file is not there."""

    name: str
    is_file: bool = False


def shape(kind: str, sizes: Sequence[float], placement: Placement, colour: str | None) -> Shape | Unseen:
    """A shape whose sizes are numbers; one of no size is not seen."""
    return (
        Shape(kind=kind, sizes=tuple(map(float, sizes)), placement=placement, colour=colour)
        if all(size > 0 for size in sizes)
        else Unseen(f"{kind} of no size")
    )


def looked(read: Callable[[], Shape | Unseen]) -> Shape | Unseen:
    """What a reader finds; where it refuses a picture's numbers it is not shown, and nothing else is the worse for it."""
    try:
        return read()
    except ModelError:
        return Unseen("visual that cannot be read")


def seen(shapes_and_reasons: Iterable[Shape | Unseen]) -> tuple[Shape, ...]:
    """Those that are seen."""
    return tuple(each for each in shapes_and_reasons if isinstance(each, Shape))


def unseen(shapes_and_reasons: Iterable[Shape | Unseen]) -> tuple[str, ...]:
    """The others, in words."""
    hidden = [each for each in shapes_and_reasons if isinstance(each, Unseen)]
    missing = list(dict.fromkeys(each.name for each in hidden if each.is_file))
    kinds = [each.name for each in hidden if not each.is_file]
    messages = [f"meshes that are not there, {missing[0]} first ({len(missing)})"] if missing else []
    return (*messages, *([f"shapes of other kinds, {kinds[0]} first ({len(kinds)})"] if kinds else []))


def shapes_on(model: Model, body: Body, origin: np.ndarray) -> tuple[Shape, ...]:
    """Shapes of a body as files say them, in a frame along the global axes: wheels and capsules as cylinders, no polygons."""
    shapes = []
    for solid in model.drawing.solids:
        if solid.body is not body or solid.kind == "polygon":
            continue
        kind = "cylinder" if solid.kind in ("wheel", "capsule") else solid.kind
        sizes, placement = solid.sizes, Placement(solid.rotation, solid.position - origin)
        if kind == "ellipsoid" and len(set(sizes)) == 1:
            kind, sizes = "sphere", sizes[:1]
        file = str((model.drawing.folder or Path()) / solid.file) if solid.file else ""
        shapes.append(Shape(kind=kind, sizes=sizes, placement=placement, colour=solid.colour, file=file))
    return tuple(shapes)


def rgba_of(colour: str) -> tuple[float, ...]:
    """Numbers from 0 to 1 of #rrggbb, and 1."""
    return (*(int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)), 1.0)


def mesh(name: str, scale: Sequence[float], placement: Placement, colour: str | None, robot: Path) -> Shape | Unseen:
    """A mesh by its address in a robot's file; robot: the path of that file."""
    path = mesh_path(name, robot)
    if path is None or not all(scale):
        return Unseen(name[:80], is_file=True)
    return Shape(kind="mesh", sizes=tuple(map(float, scale)), placement=placement, colour=colour, file=str(path))


def mesh_path(name: str, robot: Path) -> Path | None:
    """The file of an address: package://, model:// and file:// or a path from the robot's file; None where there is none."""
    kind, mark, rest = name.strip().partition("://")
    folder = robot.resolve().parent
    if not mark:
        candidates = [folder / name.strip()]
    elif kind == "file":
        candidates = [Path(unquote(rest))]
    elif kind in ("package", "model"):
        package, _, inside = rest.partition("/")
        candidates = [root / inside for root in folders_named(package, folder)]
    else:
        return None
    return next((path for path in candidates if "\0" not in str(path) and is_file(path)), None)


def folders_named(package: str, folder: Path) -> Iterable[Path]:
    """Folders of a name that may be there: the robot's file is in it or next to it, or the environment names where it is."""
    for parent in (folder, *folder.parents):
        if parent.name == package:
            yield parent
        yield parent / package
    for variable in PACKAGES:
        for root in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            yield from (Path(root) / package, Path(root) / "share" / package)


def colour_of(rgba: Sequence[float]) -> str:
    """#rrggbb of numbers from 0 to 1."""
    return "#" + "".join(f"{round(255 * min(1.0, max(0.0, value))):02x}" for value in rgba[:3])
