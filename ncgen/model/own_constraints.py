"""Declaring constraints by themselves, and drivers."""

from __future__ import annotations

from dataclasses import replace

from ncgen.errors import ModelError
from ncgen.model import measures
from ncgen.model import rows as row
from ncgen.model.bodies import Body
from ncgen.model.coordinates import Coordinates
from ncgen.model.elements import Component, Direction, Point, Relative, Vector, as_combination
from ncgen.model.facts import fact
from ncgen.model.rows import Owner, Row
from ncgen.model.value_conditions import Bound
from ncgen.model.values import Expression, Value, as_sympy

USER = Owner("user", "model")


class OwnConstraints(Coordinates):
    """The part of a model that owns constraints outside of bodies and joints, and drivers."""

    @fact
    def distance(self, start: Point, end: Point, length: Value | None = None, owner: Body | None = None) -> Row:
        """Keep the distance of two points constant, as a massless rod does (the paper's row 1000).

        Parameters
        ----------
        start, end : Point
            The points.
        length : float or expression of parameters, optional
            Distance in m. Default: the initial one.
        owner : Body, optional
            The body that the constraint belongs to, in messages and reports.

        Returns
        -------
        Row
            The constraint.
        """
        value = measures.length(start - end) if length is None else length
        number = self._number(value, f"distance {start.name}-{end.name}")
        return self._keep(row.distance(start, end, value, _owner(owner), number, self.scale), length is None)

    @fact
    def unit(self, vector: Vector, owner: Body | None = None) -> Row:
        """Keep the length of a vector at 1 (the paper's row 1001).

        Parameters
        ----------
        vector : Vector
            The vector.
        owner : Body, optional
            As of `distance`.

        Returns
        -------
        Row
            The constraint.
        """
        return self._keep(row.unit(vector, _owner(owner), self.scale))

    @fact
    def vector_segment(
        self, vector: Vector, segment: Direction, length: Value | None = None, cosine: Value | None = None, owner: Body | None = None
    ) -> Row:
        """Keep the angle between a unit vector and a segment of constant length constant (the paper's row 1002).

        Parameters
        ----------
        vector : Vector
            The unit vector.
        segment : Direction
            The segment, such as `r4 - r2`.
        length : float or expression of parameters, optional
            Length of the segment in m. Default: the initial one.
        cosine : float or expression of parameters, optional
            Cosine of the angle. Default: the initial one.
        owner : Body, optional
            As of `distance`.

        Returns
        -------
        Row
            The constraint.
        """
        label = f"angle {vector.name}, {segment}"
        segment = self._direction(segment, f"angle {vector.name}")
        measured = length is None or cosine is None
        length = measures.length(segment) if length is None else length
        Bound(
            wording=f"{label}: the length of the segment is", value=length, relation=">", unit="m", remedy="give points that are apart"
        ).check([self._number(length, label)])
        cosine = measures.cosine(as_combination(vector), segment) if cosine is None else cosine
        numeric = self._number(cosine, f"{label}, cosine")
        return self._keep(row.vector_segment(vector, segment, length, cosine, _owner(owner), numeric, self.scale), measured)

    @fact
    def vector_vector(self, u: Vector, v: Vector, cosine: Value | None = None, owner: Body | None = None) -> Row:
        """Keep the angle between two unit vectors constant (the paper's row 1003).

        Parameters
        ----------
        u, v : Vector
            The unit vectors.
        cosine : float or expression of parameters, optional
            Cosine of the angle. Default: the initial one.
        owner : Body, optional
            As of `distance`.

        Returns
        -------
        Row
            The constraint.
        """
        measured = cosine is None
        cosine = measures.cosine(as_combination(u), as_combination(v)) if cosine is None else cosine
        numeric = self._number(cosine, f"angle {u.name}, {v.name}, cosine")
        return self._keep(row.vector_vector(u, v, cosine, _owner(owner), numeric, self.scale), measured)

    @fact
    def constrain(self, expression: Expression, label: str = "constraint", owner: Owner = USER) -> Row:
        """Add a constraint of your own: an expression that stays zero.

        Parameters
        ----------
        expression : expression
            Of coordinates, `m.time` and parameters.
        label : str
            Name in messages.
        owner : Owner
            What the constraint belongs to.

        Returns
        -------
        Row
            The constraint.
        """
        return self._keep(Row(owner=owner, label=label, expression=as_sympy(expression), scaled=False))

    @fact
    def constrain_velocity(self, expression: Expression, label: str = "velocity constraint", owner: Owner = USER) -> Row:
        """Add a nonholonomic constraint: an expression that is linear in rates and stays zero.

        Parameters
        ----------
        expression : expression
            Of coordinates, rates (`q.rate`), `m.time` and parameters.
        label : str
            Name in messages.
        owner : Owner
            What the constraint belongs to.

        Returns
        -------
        Row
            The constraint.
        """
        return self._keep(Row(owner=owner, label=label, expression=as_sympy(expression), scaled=False, level="velocity"))

    @fact
    def drive(self, coordinate: Component | Relative, law: Expression) -> Row:
        """Prescribe a coordinate as a function of time (a rheonomic driver).

        Parameters
        ----------
        coordinate : Component or Relative
            The coordinate, which must be free.
        law : expression
            Value in m or rad, of `m.time` and parameters.

        Returns
        -------
        Row
            The constraint.

        Raises
        ------
        ModelError
            For a coordinate that is fixed, or driven already.
        """
        name, owner = coordinate.name, Owner("driver", coordinate.name)
        if getattr(coordinate, "fixed", False):
            raise ModelError(f"drive {name}: the coordinate is fixed; leave it free, or leave the driver out")
        if first := next((k for k, each in enumerate(self.rows, 1) if each.owner == owner), None):
            raise ModelError(f"drive {name}: constraint {first} drives it already; leave one of the two drivers out")
        self.chosen_independent = tuple(n for n in self.chosen_independent if n != name)  # what is driven is not independent
        return self.constrain(coordinate.symbol - law, f"driver of {name}", owner)

    def _keep(self, new: Row, measured: bool = False) -> Row:
        self.rows.append(replace(new, measured=measured))
        return self.rows[-1]


def _owner(body: Body | None) -> Owner:
    return USER if body is None else Owner("body", body.name)
