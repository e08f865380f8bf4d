"""The model: what a user says about a mechanism, one call a fact.

    m = Model("pendulum")
    A = m.point("A", (0, 0), fixed=True)
    B = m.point("B", (1, 0))
    bob = m.body("bob", points=[B], mass=1.0)
    m.distance(A, B)
    m.gravity((0, -9.81, 0))

Lengths are metres, masses kilograms, angles radians. Nothing is computed here beyond what is needed to
refuse a mistake on the line that makes it.
"""

from __future__ import annotations

import math

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import rows as row
from ncgen.model.bodies import Body, Inertia, check_basis, check_inertia
from ncgen.model.catalogue import BRANCH_WEIGHTS
from ncgen.model.drawing import Drawing
from ncgen.model.elements import AXES, Angle, Combination, Component, Element, Point, Spatial, Vector, as_combination
from ncgen.model.forces import Force, Potential
from ncgen.model.rows import UNIT_LENGTH, Owner, Row
from ncgen.model.values import Parameter, as_sympy, as_value, evaluate, is_number

USER = Owner("user", "model")
ANGLE_FORMS = ("smooth", "paper", "sine", "cosine")


class Model:
    """A mechanism in natural coordinates.

    name: becomes the prefix of the generated code
    scale: True divides every row by its natural length, so that metres and millimetres converge alike;
        False gives the paper's raw rows
    form: how relative angles are tied to points and vectors, see `angle`
    """

    def __init__(self, name: str, *, scale: bool = True, form: str = "smooth"):
        _check_name(name, "model")
        self.name = name
        self.scale = scale
        self.form = _check_form(form)
        self.elements: dict[str, Element] = {}
        self.parameters: dict[str, Parameter] = {}
        self.bodies: dict[str, Body] = {}
        self.rows: list[Row] = []
        self.forces: list[Force] = []
        self.potentials: list[Potential] = []
        self.gravity_field: tuple = (0.0, 0.0, 0.0)
        self.branches: dict[str, tuple[Parameter, ...]] = {}
        self.chosen_independent: tuple[str, ...] = ()
        self.drawing = Drawing()
        self.simulation_options: dict[str, object] = {}

    def __repr__(self):
        return f"<Model {self.name}: {len(self.components)} coordinates, {len(self.rows)} rows, {len(self.bodies)} bodies>"

    # -- coordinates ---------------------------------------------------------------------------

    @property
    def components(self) -> list[Component]:
        """All scalar coordinates in the order of q, free and fixed."""
        return [component for element in self.elements.values() for component in element.components]

    @property
    def time(self):
        """The sympy symbol of time, for drivers and forces."""
        import sympy

        return sympy.Symbol("t", real=True)

    def parameter(self, name: str, default: float, unit: str = "") -> Parameter:
        """A number with a name, kept symbolic in the kernels and given in `p` at run time."""
        self._claim(name, "parameter")
        default = as_value(default, f"parameter {name}")
        parameter = Parameter(name, default, unit)
        self.parameters[name] = parameter
        return parameter

    def point(self, name: str, position, fixed: bool | str = False) -> Point:
        """A point (m). Two numbers make a point of the plane z = 0.

        fixed: True, False, or the axes that cannot move, such as "z" or "xz".
        """
        return self._add(Point, name, position, fixed)

    def vector(self, name: str, direction, fixed: bool | str = False) -> Vector:
        """A unit vector; refused if its length is not 1. Its unit row is added by the body that owns it."""
        vector = self._add(Vector, name, direction, fixed, keep=False)
        size = np.linalg.norm(vector.initial)
        if abs(size - 1.0) > UNIT_LENGTH:
            raise ModelError(f"vector {name}: its length is {size:.12g}, not 1; divide it by its length")
        self.elements[name] = vector
        return vector

    def angle(
        self, name: str, start, end, axis, *, form: str | None = None, lengths=None, initial: float | None = None
    ) -> Angle:
        """A relative angle as a coordinate (rad), from `start` to `end`, positive about `axis`.

        start, end, axis: vectors, or segments such as `r4 - r2`, or either reversed (`-u3`)
        form: "smooth" (the default of the model unless changed), "cosine", "sine", or "paper", which
            follows the paper's rule of cosine or sine by the angle's value, chosen at run time
        lengths: of start, end and axis, 1 for unit vectors (default: measured)
        initial: the angle in the initial position, if it should count turns (default: measured, in (−π, π])
        """
        self._claim(name, "angle")
        form = _check_form(form or self.form)
        start, end, axis = (self._direction(d, f"angle {name}") for d in (start, end, axis))
        if row.shape(start) == "segment" and row.shape(end) == "vector":
            # Table 4 has no such code: the same angle is measured from the vector, about the reversed axis.
            start, end, axis = end, start, -axis
            lengths = lengths and (lengths[1], lengths[0], lengths[2])
        measured = _measure(name, start, end, axis)
        initial = measured if initial is None else as_value(initial, f"angle {name}")
        component = Component(name, False, initial, initial)
        psi = Angle(name, (component,), start, end, axis)
        branch = self._branch(name, psi, measured) if form == "paper" else ()
        self.elements[name] = psi
        self.rows.append(row.angle(psi, form, lengths, branch, self.scale))
        return psi

    def independent(self, *coordinates) -> None:
        """Choose the independent coordinates z of coordinate partitioning (default: found by pivoting)."""
        names = [c if isinstance(c, str) else c.components[0].name if isinstance(c, Angle) else c.name for c in coordinates]
        known = {c.name: c for c in self.components}
        for name in names:
            if name not in known or known[name].fixed:
                raise ModelError(f"independent coordinate {name}: it is not a free coordinate of this model; name one that is")
        self.chosen_independent = tuple(names)

    # -- bodies and rows -----------------------------------------------------------------------

    def body(self, name: str, points=(), vectors=(), mass=None, com=None, inertia=None, basis=None) -> Body:
        """A rigid body.

        points, vectors: the elements that move with it
        mass: kg; None for a body without inertia
        com: centre of mass (m, global axes, initial position); default: the middle of the basis' points
        inertia: tensor about the centre of mass (kg m², global axes, initial position), 3×3, its diagonal, or one
            number for a flat body (the moment about z); default 0
        basis: the elements that carry the inertia (default: all points, then all vectors)
        """
        _check_name(name, "body")
        if name in self.bodies:
            raise ModelError(f"body {name}: there is already a body of that name; choose another")
        points = tuple(self._own(p, Point, f"body {name}") for p in points)
        vectors = tuple(self._own(v, Vector, f"body {name}") for v in vectors)
        moving = None
        if mass is not None:
            mass = as_value(mass, f"body {name}, mass")
            basis = tuple(self._own(e, Spatial, f"body {name}") for e in basis) if basis is not None else points + vectors
            check_basis(name, basis)
            middle = np.mean([e.initial for e in basis if isinstance(e, Point)], axis=0)
            com = middle if com is None else np.asarray(com, dtype=float)
            tensor = check_inertia(name, mass, com, np.zeros((3, 3)) if inertia is None else inertia)
            moving = Inertia(mass, com, tensor, basis)
        self.bodies[name] = Body(name, points, vectors, moving)
        return self.bodies[name]

    def distance(self, start: Point, end: Point, length=None, owner: Body | None = None) -> Row:
        """Row 1000: a constant distance (m; default: the one of the initial position)."""
        start, end = (self._own(p, Point, "distance") for p in (start, end))
        value = row.length(start - end) if length is None else as_value(length, f"distance {start.name}-{end.name}")
        number = evaluate(value, self.parameters, f"distance {start.name}-{end.name}")
        return self._keep(row.distance(start, end, value, _owner(owner), number, self.scale))

    def unit(self, vector: Vector, owner: Body | None = None) -> Row:
        """Row 1001: a vector keeps its unit length."""
        return self._keep(row.unit(self._own(vector, Vector, "unit"), _owner(owner), self.scale))

    def vector_segment(self, vector: Vector, segment, length=None, cosine=None, owner: Body | None = None) -> Row:
        """Row 1002: a constant angle between a unit vector and a segment of constant length."""
        vector = self._own(vector, Vector, "vector_segment")
        segment = self._direction(segment, f"angle {vector.name}")
        length = row.length(segment) if length is None else as_value(length, f"angle {vector.name}, {segment}")
        if is_number(length) and not length > 0:
            raise ModelError(f"angle {vector.name}, {segment}: the segment has length {length:g} m; give points that are apart")
        cosine = _cosine(vector.initial, segment.initial) if cosine is None else as_value(cosine, "cosine")
        return self._keep(row.vector_segment(vector, segment, length, cosine, _owner(owner), self.scale))

    def vector_vector(self, u: Vector, v: Vector, cosine=None, owner: Body | None = None) -> Row:
        """Row 1003: a constant angle between two unit vectors."""
        u, v = (self._own(w, Vector, "vector_vector") for w in (u, v))
        cosine = _cosine(u.initial, v.initial) if cosine is None else as_value(cosine, "cosine")
        return self._keep(row.vector_vector(u, v, cosine, _owner(owner), self.scale))

    def constrain(self, expression, label: str = "constraint", owner: Owner = USER) -> Row:
        """A constraint of your own: a sympy expression of coordinates, `m.time` and parameters that stays zero."""
        return self._keep(Row(owner, label, expression=as_sympy(expression), scaled=False))

    def drive(self, coordinate: Component | Angle, law) -> Row:
        """A rheonomic driver: coordinate = law(t), a sympy expression of `m.time` and parameters."""
        name = coordinate.name
        return self.constrain(coordinate.symbol - as_sympy(law), f"driver of {name}", Owner("driver", name))

    # -- forces --------------------------------------------------------------------------------

    def gravity(self, field) -> None:
        """The acceleration of gravity (m/s²), three values."""
        if len(field) != 3:
            raise ModelError(f"gravity: {len(field)} numbers given; give three, for example (0, 0, -9.81)")
        self.gravity_field = tuple(as_value(g, "gravity") for g in field)

    def force(self, point: Point, vector, label: str | None = None) -> Force:
        """A force (N) on a point: three numbers or expressions of m.time, coordinates, rates and parameters."""
        point = self._own(point, Point, "force")
        return self._apply(label or f"force on {point.name}", zip(point.components, vector, strict=True))

    def torque(self, angle: Angle, expression, label: str | None = None) -> Force:
        """A couple (N m) along a relative angle, such as a motor."""
        angle = self._own(angle, Angle, "torque")
        return self._apply(label or f"torque on {angle.name}", [(angle.components[0], expression)])

    def potential(self, expression, label: str = "potential") -> Potential:
        """A potential energy (J) as an expression of coordinates and parameters; its force follows."""
        self.potentials.append(Potential(label, as_sympy(expression)))
        return self.potentials[-1]

    def simulation(self, **options) -> None:
        """What `ncgen run` does with this model unless told otherwise: arguments of `ncgen.simulate` by name."""
        self.simulation_options = options

    # -- drawing -------------------------------------------------------------------------------

    def line(self, *points: Point) -> None:
        """Draw a line through these points."""
        own = [self._own(p, Point, "line") for p in points]
        self.drawing.lines += zip(own, own[1:])

    def arrow(self, point: Point, vector: Vector) -> None:
        """Draw a unit vector at a point."""
        self.drawing.arrows.append((self._own(point, Point, "arrow"), self._own(vector, Vector, "arrow")))

    # -- helpers -------------------------------------------------------------------------------

    @classmethod
    def from_tables(cls, P, U, CONSTR, **options) -> Model:
        """A model from the paper's Tables 1-7 as printed, see `ncgen.model.tables.from_tables`."""
        from ncgen.model.tables import from_tables

        return from_tables(cls, P, U, CONSTR, **options)

    def _claim(self, name: str, what: str) -> None:
        _check_name(name, what)
        taken = self.elements.get(name) or self.parameters.get(name)
        if taken:
            raise ModelError(f"{what} {name}: the name is already used for {taken!r}; choose another")

    def _add(self, kind, name, position, fixed, keep=True):
        what = kind.__name__.lower()
        self._claim(name, what)
        position = tuple(position)
        if len(position) == 2:
            position, fixed = (*position, 0.0), fixed if fixed is True else f"{fixed or ''}z"
        if len(position) != 3:
            raise ModelError(f"{what} {name}: {len(position)} numbers given; give three, or two for the plane z = 0")
        held = AXES if fixed is True else fixed or ""
        components = []
        for axis, value in zip(AXES, position, strict=True):
            where = f"{what} {name}, {axis}"
            value = as_value(value, where)
            number = evaluate(value, self.parameters, where)
            is_fixed = axis in held
            components.append(Component(f"{name}.{axis}", is_fixed, value if is_fixed else number, number))
        element = kind(name, tuple(components))
        if keep:
            self.elements[name] = element
        return element

    def _own(self, thing, kind, where: str):
        if isinstance(thing, str):
            if thing not in self.elements:
                raise ModelError(f"{where}: there is no {kind.__name__.lower()} {thing}; define it first")
            thing = self.elements[thing]
        if not isinstance(thing, kind):
            raise ModelError(f"{where}: {thing!r} is not a {kind.__name__.lower()}")
        if self.elements.get(thing.name) is not thing:
            raise ModelError(f"{where}: {thing!r} belongs to another model; use this model's own")
        return thing

    def _direction(self, thing, where: str) -> Combination:
        direction = as_combination(thing)
        for element in direction.elements:
            self._own(element, Spatial, where)
        if not direction.is_direction:
            raise ModelError(f"{where}: {direction} is not a direction; give a vector or a difference of points")
        if not np.linalg.norm(direction.initial) > 0:
            raise ModelError(f"{where}: {direction} has length 0; give points that are apart")
        return direction

    def _keep(self, new: Row) -> Row:
        self.rows.append(new)
        return new

    def _apply(self, label: str, components) -> Force:
        pairs = tuple((component, as_sympy(expression)) for component, expression in components)
        for component, expression in pairs:
            if is_number(expression):
                as_value(expression, f"{label}, {component.name}")
        self.forces.append(Force(label, pairs))
        return self.forces[-1]

    def _branch(self, name: str, psi: Angle, measured: float) -> tuple[Parameter, ...]:
        """Run-time weights of the paper's rule, with its choice in the initial position as default."""
        chosen = paper_choice(measured, psi.axis.initial)
        weights = tuple(self.parameter(f"{name}.{w}", float(i == chosen)) for i, w in enumerate(BRANCH_WEIGHTS))
        self.branches[name] = weights
        return weights


def paper_choice(psi: float, axis: np.ndarray) -> int:
    """The paper's rule: 0 for the cosine row where |sin ψ| > √½, else 1 + the axis' largest component."""
    return 0 if abs(math.sin(psi)) > math.sqrt(0.5) else 1 + row.largest_component(axis)


def _measure(name: str, start: Combination, end: Combination, axis: Combination) -> float:
    a, b, n = start.initial, end.initial, axis.initial / np.linalg.norm(axis.initial)
    for direction, vector in ((start, a), (end, b)):
        if np.linalg.norm(vector - (vector @ n) * n) < 1e-9 * np.linalg.norm(vector):
            raise ModelError(f"angle {name}: {direction} is parallel to the axis {axis}; no angle about it is defined, choose another")
    return math.atan2(np.cross(a, b) @ n, a @ b - (a @ n) * (b @ n))


def _cosine(a: np.ndarray, b: np.ndarray) -> float:
    cosine = float(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)))
    return 0.0 if abs(cosine) < 4 * np.finfo(float).eps else cosine


def _owner(body: Body | None) -> Owner:
    return USER if body is None else Owner("body", body.name)


def _check_form(form: str) -> str:
    if form not in ANGLE_FORMS:
        raise ModelError(f"form {form!r} is unknown; choose one of {', '.join(ANGLE_FORMS)}")
    return form


def _check_name(name: str, what: str) -> None:
    if not isinstance(name, str) or not name or not all(c.isalnum() or c in "_.-" for c in name) or not name[0].isalpha():
        raise ModelError(f"{what} name {name!r}: give a word of letters, digits, '_' and '-' that begins with a letter")
