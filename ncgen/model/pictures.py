"""Declaring what is seen: lines, arrows, and the shapes of bodies. Nothing of it changes an equation or a byte of generated code.

A shape stands where it is in the initial position, in global axes, as centres of mass and attached points do, and moves with its body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ncgen.errors import ModelError, counted
from ncgen.model.bodies import Body
from ncgen.model.contents import Contents
from ncgen.model.elements import Point, Vector
from ncgen.model.facts import fact
from ncgen.model.shapes import Solid, Strut, check_colour, check_sizes, normal_of, rotation_of, rotation_to
from ncgen.model.values import Number, Numbers

NO_TURN = (0.0, 0.0, 0.0)


class Pictures(Contents):
    """The part of a model that is only looked at."""

    @fact
    def line(self, *points: Point) -> None:
        """Draw a line through points.

        Parameters
        ----------
        *points : Point
            Two points or more, in their order.
        """
        if len(points) < 2:
            raise ModelError(f"line: {counted(len(points), 'point')} given; give two or more")
        self.drawing.lines += zip(points, points[1:])

    @fact
    def arrow(self, point: Point, vector: Vector) -> None:
        """Draw a unit vector at a point.

        Parameters
        ----------
        point : Point
            Where it begins.
        vector : Vector
            The unit vector.
        """
        self.drawing.arrows.append((point, vector))

    @fact
    def range(self, number: str, low: Number, high: Number) -> None:
        """Offer a number first in the page of the model (`ncgen export MODEL --to html`), with a slider.

        Parameters
        ----------
        number : str
            A parameter or an input, or a plain number by the name that the page gives it, such as `B.position.x`, `crank.mass` or
            `gravity.y`.
        low, high : float
            Ends of the slider.
        """
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ModelError(f"range of {number}: from {low:g} to {high:g}; give two numbers that increase")
        self.drawing.ranges[number] = float(low), float(high)

    @fact
    def box(
        self, body: Body, size: Numbers, position: Numbers | None = None, rotation: Numbers = NO_TURN, *, colour: str | None = None
    ) -> None:
        """Show a body as a box.

        Parameters
        ----------
        body : Body
            The body, with which the box moves.
        size : array_like, shape (3,)
            Its sides in m along its own axes.
        position : array_like, shape (3,), optional
            Its middle in m, in global axes and the initial position. Default: the middle of the body's points.
        rotation : array_like, shape (3,)
            Roll, pitch and yaw in rad of its axes about the fixed axes x, y and z.
        colour : str, optional
            As #rrggbb. Default: one of its own for every body.
        """
        self._solid(body, "box", check_sizes(size, 3, f"box of {body.name}", "size"), position, _turn(rotation, body), colour)

    @fact
    def cylinder(
        self,
        body: Body,
        radius: Number,
        length: Number,
        position: Numbers | None = None,
        axis: Numbers = (0, 0, 1),
        *,
        colour: str | None = None,
    ) -> None:
        """Show a body as a cylinder.

        Parameters
        ----------
        body : Body
            The body, with which the cylinder moves.
        radius, length : float
            Its size in m.
        position : array_like, shape (3,), optional
            Its middle in m, as of `box`.
        axis : array_like, shape (3,)
            Direction of its axis, in global axes and the initial position.
        colour : str, optional
            As of `box`.
        """
        self._round(body, "cylinder", (radius, length), position, axis, colour)

    @fact
    def capsule(
        self,
        body: Body,
        radius: Number,
        length: Number,
        position: Numbers | None = None,
        axis: Numbers = (0, 0, 1),
        *,
        colour: str | None = None,
    ) -> None:
        """Show a body as a cylinder with round ends.

        Parameters
        ----------
        body : Body
            The body, with which the capsule moves.
        radius, length : float
            Radius, and distance of the middles of its ends, in m.
        position : array_like, shape (3,), optional
            Its middle in m, as of `box`.
        axis : array_like, shape (3,)
            Direction of its axis, as of `cylinder`.
        colour : str, optional
            As of `box`.
        """
        self._round(body, "capsule", (radius, length), position, axis, colour)

    @fact
    def wheel(
        self,
        body: Body,
        radius: Number,
        width: Number,
        position: Numbers | None = None,
        axis: Numbers = (0, 1, 0),
        *,
        colour: str | None = None,
    ) -> None:
        """Show a body as a wheel with spokes, which show how it turns.

        Parameters
        ----------
        body : Body
            The body, with which the wheel moves.
        radius, width : float
            Its size in m.
        position : array_like, shape (3,), optional
            Its middle in m, as of `box`.
        axis : array_like, shape (3,)
            Direction of its axle, as of `cylinder`.
        colour : str, optional
            As of `box`.
        """
        self._round(body, "wheel", (radius, width), position, axis, colour)

    @fact
    def sphere(self, body: Body, radius: Number, position: Numbers | None = None, *, colour: str | None = None) -> None:
        """Show a body as a sphere.

        Parameters
        ----------
        body : Body
            The body, with which the sphere moves.
        radius : float
            Its radius in m.
        position : array_like, shape (3,), optional
            Its middle in m, as of `box`.
        colour : str, optional
            As of `box`.
        """
        sizes = check_sizes((radius,), 1, f"sphere of {body.name}", "radius") * 3
        self._solid(body, "ellipsoid", sizes, position, np.eye(3), colour)

    @fact
    def ellipsoid(
        self, body: Body, radii: Numbers, position: Numbers | None = None, rotation: Numbers = NO_TURN, *, colour: str | None = None
    ) -> None:
        """Show a body as an ellipsoid.

        Parameters
        ----------
        body : Body
            The body, with which the ellipsoid moves.
        radii : array_like, shape (3,)
            Radii in m along its own axes.
        position : array_like, shape (3,), optional
            Its middle in m, as of `box`.
        rotation : array_like, shape (3,)
            Of its axes, as of `box`.
        colour : str, optional
            As of `box`.
        """
        self._solid(body, "ellipsoid", check_sizes(radii, 3, f"ellipsoid of {body.name}", "radii"), position, _turn(rotation, body), colour)

    @fact
    def polygon(self, body: Body, corners: Sequence[Numbers], thickness: Number = 0.0, *, colour: str | None = None) -> None:
        """Show a body as a flat polygon.

        Parameters
        ----------
        body : Body
            The body, with which the polygon moves.
        corners : sequence of array_like, shape (3,)
            Corners in m in their order around it, in global axes and the initial position.
        thickness : float
            In m, half of it to either side.
        colour : str, optional
            As of `box`.
        """
        where = f"polygon of {body.name}"
        if len(corners) < 3:
            raise ModelError(f"{where}: {len(corners)} corners given; give three or more")
        positions = np.array([_place(corner, where) for corner in corners])
        normal = normal_of(positions, where)
        if not thickness >= 0:
            raise ModelError(f"{where}: the thickness is {float(thickness):g} m; give a positive number, or none")
        self._add(
            Solid(
                body=body,
                kind="polygon",
                sizes=(float(thickness),),
                position=positions[0],
                rotation=rotation_to(normal),
                colour=check_colour(colour, where),
                corners=positions,
            )
        )

    @fact
    def mesh(
        self,
        body: Body,
        file: str,
        position: Numbers = NO_TURN,
        rotation: Numbers = NO_TURN,
        scale: Numbers = (1, 1, 1),
        *,
        colour: str | None = None,
    ) -> None:
        """Show a body as the triangles of a file (STL, OBJ or DAE), which is opened when a picture is made.

        A file that is missing or too large is reported in one line when a picture is made, and left out.

        Parameters
        ----------
        body : Body
            The body, with which the triangles move.
        file : str
            Name of the file, from the folder of the model's file, or from the working directory for a model in Python.
        position, rotation : array_like, shape (3,)
            Of the file's coordinates in the global ones, in m and rad as of `box`, in the initial position.
        scale : array_like, shape (3,)
            Factors along its axes: (0.001, 0.001, 0.001) for a file in millimetres.
        colour : str, optional
            As of `box`.
        """
        where = f"mesh {file}"
        if not file or "\0" in file or "://" in file:
            raise ModelError(f"mesh of {body.name}: {file!r} is no name of a file; nothing is fetched from elsewhere")
        if len(scale) != 3 or not all(scale):
            raise ModelError(f"{where}: the scale is three numbers that are not 0")
        origin = _place(position, where)
        factors = tuple(map(float, scale))
        self._add(
            Solid(
                body=body,
                kind="mesh",
                sizes=factors,
                position=origin,
                rotation=_turn(rotation, body),
                colour=check_colour(colour, where),
                file=file,
            )
        )

    @fact
    def bar(self, start: Point, end: Point, radius: Number, *, colour: str | None = None) -> None:
        """Show a round bar between two points.

        Parameters
        ----------
        start, end : Point
            Its ends.
        radius : float
            Radius in m.
        colour : str, optional
            As of `box`.
        """
        self._strut(start, end, radius, None, colour, "bar")

    @fact
    def telescope(self, start: Point, end: Point, radius: Number, length: Number | None = None, *, colour: str | None = None) -> None:
        """Show a cylinder of variable length between two points, such as that of an excavator: a barrel at the start, and a rod out of it.

        Parameters
        ----------
        start, end : Point
            Its ends.
        radius : float
            Radius of the barrel in m.
        length : float, optional
            Length of the barrel in m. Default: six tenths of the initial distance.
        colour : str, optional
            As of `box`.
        """
        barrel = 0.6 * float(np.linalg.norm(end.initial - start.initial)) if length is None else length
        (barrel,) = check_sizes((barrel,), 1, f"telescope {start.name}-{end.name}", "length")
        self._strut(start, end, radius, barrel, colour, "telescope")

    # -- helpers -------------------------------------------------------------------------------

    def _round(
        self, body: Body, kind: str, sizes: tuple[Number, Number], position: Numbers | None, axis: Numbers, colour: str | None
    ) -> None:
        where = f"{kind} of {body.name}"
        direction = _place(axis, where)
        if not direction.any():
            raise ModelError(f"{where}: its axis is 0; give a direction")
        self._solid(body, kind, check_sizes(sizes, 2, where, "radius or length"), position, rotation_to(direction), colour)

    def _solid(
        self, body: Body, kind: str, sizes: tuple[float, ...], position: Numbers | None, rotation: np.ndarray, colour: str | None
    ) -> None:
        where = f"{kind} of {body.name}"
        if position is None and not body.points:
            raise ModelError(f"{where}: it has no point to stand at; give its position")
        origin = np.mean([p.initial for p in body.points], axis=0) if position is None else _place(position, where)
        self._add(Solid(body=body, kind=kind, sizes=sizes, position=origin, rotation=rotation, colour=check_colour(colour, where)))

    def _strut(self, start: Point, end: Point, radius: Number, length: float | None, colour: str | None, kind: str) -> None:
        where = f"{kind} {start.name}-{end.name}"
        if start is end:
            raise ModelError(f"{where}: both ends are one point; give two")
        (thick,) = check_sizes((radius,), 1, where, "radius")
        self.drawing.struts.append(Strut(start=start, end=end, radius=thick, length=length, colour=check_colour(colour, where)))

    def _add(self, solid: Solid) -> None:
        if solid.body is not self.ground and not solid.body.points:
            raise ModelError(f"{solid.kind} of {solid.body.name}: the body has no point that could carry it; give it one")
        self.drawing.solids.append(solid)


def _place(position: Numbers, where: str) -> np.ndarray:
    """Three numbers, or two in the plane z = 0."""
    if len(position) not in (2, 3):
        raise ModelError(f"{where}: {counted(len(position), 'number')} given; give three, or two in the plane")
    return np.array([*position, 0.0][:3], dtype=float)


def _turn(rotation: Numbers, body: Body) -> np.ndarray:
    if len(rotation) != 3:
        raise ModelError(f"rotation of a shape of {body.name}: {counted(len(rotation), 'number')} given; give roll, pitch and yaw (rad)")
    return rotation_of(tuple(map(float, rotation)))
