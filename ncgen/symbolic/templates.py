"""Templates: what a kind of row, mass or force contributes, derived once with sympy.

A template is written over *scalars* (each a linear form of coordinates, such as the x of a segment),
their rates, time, and *data* (constants or parameters). Its outputs say how it enters the equations:

    phi, nu, gamma            a constraint row
    phi_q (k)                 the row's derivative by scalar k
    mass (k, l)               mass between scalars k and l
    force (k)                 generalised force along scalar k
    kinetic, potential, power     energy (J), and the power (W) of forces without a potential

Where scalars are combined from coordinates, the chain rule is applied later, on programs; so one
derivation serves every mechanism and every pattern of fixed and free coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, partial
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple, TypeAlias, cast

from ncgen.model.catalogue import ROW_TYPES, RowType
from ncgen.model.elements import AXES, rate_name
from ncgen.model.forces import FORCE_TYPES, ForceType
from ncgen.model.names import LAW, TIME

if TYPE_CHECKING:
    import sympy

SCALE = "scale"
USER_FORCE = "user force"


class TemplateOutput(NamedTuple):
    """What an output of a template is: its name, and the numbers of the scalars that it belongs to."""

    name: str
    scalars: tuple[int, ...] = ()


Outputs: TypeAlias = "dict[TemplateOutput, sympy.Expr]"


class DeferredOutputs(Mapping[TemplateOutput, "sympy.Expr"]):
    """Outputs that sympy derives when something asks for one of them."""

    def __init__(self, derive: Callable[[], Outputs]) -> None:
        self._derive = derive

    @cached_property
    def _outputs(self) -> Outputs:
        return self._derive()

    def __getitem__(self, output: TemplateOutput) -> sympy.Expr:
        return self._outputs[output]

    def __iter__(self) -> Iterator[TemplateOutput]:
        return iter(self._outputs)

    def __len__(self) -> int:
        return len(self._outputs)


@dataclass(frozen=True, eq=False, kw_only=True)
class Template:
    """Outputs as sympy expressions over the symbols of `scalars`, their rates, `data` and time.

    is_catalogued: whether the key names it among all mechanisms, since no user wrote any of it
    """

    key: str
    equation: str
    scalars: tuple[str, ...]
    data: tuple[str, ...]
    outputs: Mapping[TemplateOutput, sympy.Expr] = field(repr=False)
    is_catalogued: bool = False


def symbols(names: Iterable[str]) -> list[sympy.Symbol]:
    import sympy

    return [sympy.Symbol(name, real=True) for name in names]


def time() -> sympy.Symbol:
    """The symbol of time."""
    return symbols([TIME])[0]


def rates(names: Iterable[str]) -> list[sympy.Symbol]:
    return symbols(map(rate_name, names))


def vector(name: str) -> tuple[str, ...]:
    """The scalar names of a 3-vector argument."""
    return tuple(f"{name}_{axis}" for axis in AXES)


def replaced(expression: sympy.Expr, rules: Mapping[sympy.Symbol, sympy.Expr]) -> sympy.Expr:
    """The expression with others in place of symbols."""
    return cast("sympy.Expr", expression.xreplace(rules))  # sympy says no more than Basic


def differentiate(phi: sympy.Expr, scalars: tuple[str, ...]) -> Outputs:
    """The outputs of a constraint row: Φ, Φ_q, ν = −Φ_t and γ = −(Φ_q q̇)_q q̇ − 2Φ_qt q̇ − Φ_tt.

    γ is the second derivative along the motion that continues straight: −d²/dε² Φ(q + ε q̇, t + ε) at ε = 0.
    Taken so, the products of Φ stay products; building the Hessian first costs twice the operations.
    """
    import sympy

    x, v = symbols(scalars), rates(scalars)
    smooth, whole = _beside_kinks(phi)
    step = sympy.Dummy("step", real=True)
    moved = {s: s + step * rate for s, rate in zip(x, v, strict=True)} | {time(): time() + step}
    curvature = replaced(replaced(smooth, moved).diff(step, 2), {step: sympy.Integer(0)})
    outputs: Outputs = {TemplateOutput("nu"): -smooth.diff(time()), TemplateOutput("gamma"): -curvature}
    outputs.update({TemplateOutput("phi_q", (k,)): smooth.diff(s) for k, s in enumerate(x)})
    return {TemplateOutput("phi"): phi, **{key: whole(value) for key, value in outputs.items()}}


def _beside_kinks(expression: sympy.Expr) -> tuple[sympy.Expr, Callable[[sympy.Expr], sympy.Expr]]:
    """The expression with constants for the signs in it, |u| being sign(u) u, and a function that puts the signs back.

    Its derivatives are those near the kinks, where they are used; sympy's own have Dirac impulses, and derivatives of these.
    """
    import sympy

    signs: dict[sympy.Symbol, sympy.Expr] = {}

    def constant(u: sympy.Expr) -> sympy.Dummy:
        signs[made := sympy.Dummy("sign", real=True)] = sympy.sign(u)
        return made

    def whole(derived: sympy.Expr) -> sympy.Expr:
        for made, sign in reversed(signs.items()):  # outer ones first: their arguments have inner ones
            derived = replaced(derived, {made: sign})
        return derived

    smooth = expression.replace(sympy.Abs, lambda u: constant(u) * u).replace(sympy.sign, constant)
    return (cast("sympy.Expr", smooth), whole) if signs else (expression, lambda derived: derived)  # sympy says no more than Basic


@cache
def row_template(key: str) -> Template:
    """The derivation of one row type of the catalogue."""
    row: RowType = ROW_TYPES[key]
    scalars = sum(map(vector, row.vectors), ()) + row.scalars
    return Template(
        key=key,
        equation=row.equation,
        scalars=scalars,
        data=row.data + (SCALE,),
        outputs=DeferredOutputs(partial(_derived_row, row, scalars)),
        is_catalogued=True,
    )


def _derived_row(row: RowType, scalars: tuple[str, ...]) -> Outputs:
    """The outputs of a row type over its scalars, times its scale."""
    import sympy

    arguments: dict[str, sympy.Symbol | tuple[sympy.Symbol, ...]] = {name: tuple(symbols(vector(name))) for name in row.vectors}
    arguments |= {name: sympy.Symbol(name, real=True) for name in row.scalars + row.data}
    raw: sympy.Expr = row.formula(sympy, **arguments)
    scale = sympy.Symbol(SCALE, real=True)
    return {name: scale * value for name, value in differentiate(raw, scalars).items()}


def expression_row_template(key: str, phi: sympy.Expr, scalars: tuple[str, ...], data: tuple[str, ...]) -> Template:
    """A row the user wrote out: its scalars are the coordinates themselves."""
    return Template(key=key, equation=f"{phi}", scalars=scalars, data=data, outputs=differentiate(phi, scalars))


def velocity_row_template(key: str, psi: sympy.Expr, scalars: tuple[str, ...], data: tuple[str, ...]) -> Template:
    """A nonholonomic row the user wrote out, linear in rates: B(q) q̇ = ν stands where Φ_q q̇ = ν does, and Φ = 0.

    γ = −Ḃ q̇ + ν̇. Raises ValueError if the expression is not linear in the rates.
    """
    import sympy

    x, v = symbols(scalars), rates(scalars)
    smooth, whole = _beside_kinks(psi)
    still = dict.fromkeys(v, sympy.Integer(0))
    B = [psi.diff(rate) for rate in v]
    if any(slope.has(*v) for slope in B if v):
        raise ValueError("it is not linear in the rates")
    change = sympy.Add(smooth.diff(time()), *(smooth.diff(s) * rate for s, rate in zip(x, v, strict=True)))
    outputs: Outputs = {
        TemplateOutput("phi"): sympy.Integer(0),
        TemplateOutput("nu"): -replaced(psi, still),
        TemplateOutput("gamma"): whole(-change),
    }
    outputs.update({TemplateOutput("phi_q", (k,)): slope for k, slope in enumerate(B)})
    return Template(key=key, equation=f"{psi}", scalars=scalars, data=data, outputs=outputs)


def derived_force(kind: ForceType) -> Template:
    """Generalised forces, energy and power of a force type, a user's own among them."""
    import sympy

    scalars = sum(map(vector, kind.vectors), ()) + kind.scalars
    data = {name: sympy.Symbol(name, real=True) for name in kind.data}
    if kind.forces is not None:
        outputs_of_kind = kind.forces(sympy, **{name: symbols(vector(name)) for name in kind.vectors}, **data)
        return Template(
            key=kind.key,
            equation=kind.equation,
            scalars=scalars,
            data=kind.data,
            outputs=_working(dict(enumerate(chain.from_iterable(outputs_of_kind))), scalars),
        )
    x, v, direction = _stretch(scalars)
    at = sympy.Dummy("x", real=True)
    slope = sympy.factor_terms(kind.potential(sympy, at, **data).diff(at))  # of k (x - L0)^2/2 it is k (2 x - 2 L0)/2 before
    friction = kind.friction(sympy, x, v, **data)
    parts = (replaced(slope, {at: x}), friction)
    tension = parts if kind.regular else (sympy.Add(*parts),)
    outputs: Outputs = {TemplateOutput("force", (k,)): sympy.Add(*(-term * along for term in tension)) for k, along in enumerate(direction)}
    outputs |= {TemplateOutput("potential"): kind.potential(sympy, x, **data), TemplateOutput("power"): -friction * v}
    return Template(key=kind.key, equation=kind.equation, scalars=scalars, data=kind.data, outputs=outputs)


def varying_force(
    kind: ForceType, key: str, written: Sequence[sympy.Expr], coordinates: tuple[str, ...], numbers: tuple[str, ...]
) -> Template:
    """A force type of forces along vectors whose constants are expressions of coordinates, their rates, time and numbers.

    The scalars are those of the type, then the coordinates; a coordinate and a number may be called like an argument of the type.
    """
    import sympy

    assert kind.forces is not None, f"{kind.key} has a tension"
    law_scalars, data = tuple(f"law.{name}" for name in coordinates), tuple(f"law.{name}" for name in numbers)
    old = [*symbols(coordinates), *rates(coordinates), *symbols(numbers)]
    rules = dict(zip(old, [*symbols(law_scalars), *rates(law_scalars), *symbols(data)], strict=True))
    constants = {name: replaced(e, rules) for name, e in zip(kind.data, written, strict=True)}
    outputs = kind.forces(sympy, **{name: symbols(vector(name)) for name in kind.vectors}, **constants)
    scalars = (*sum(map(vector, kind.vectors), ()), *law_scalars)
    return Template(
        key=key,
        equation=kind.equation,
        scalars=scalars,
        data=data,
        outputs=_working(dict(enumerate(chain.from_iterable(outputs))), scalars),
    )


@cache
def force_template(kind: ForceType) -> Template:
    """The derivation of one force type of the catalogue."""
    scalars = sum(map(vector, kind.vectors), ()) + kind.scalars
    derived = DeferredOutputs(partial(_derived_force, kind))
    return Template(key=kind.key, equation=kind.equation, scalars=scalars, data=kind.data, outputs=derived, is_catalogued=True)


def _derived_force(kind: ForceType) -> Outputs:
    return dict(derived_force(kind).outputs)


def _stretch(scalars: tuple[str, ...]) -> tuple[sympy.Expr, sympy.Expr, list[sympy.Expr]]:
    """What a tension pulls along, the length of a vector or one scalar: its value, its rate and its gradient."""
    import sympy

    s, ds = symbols(scalars), rates(scalars)
    if len(s) == 1:
        return s[0], ds[0], [sympy.Integer(1)]
    length = sympy.sqrt(sum(c * c for c in s))
    return length, sum((c * d for c, d in zip(s, ds, strict=True)), sympy.Integer(0)) / length, [c / length for c in s]


def law_type(kind: ForceType, key: str, law: sympy.Expr, names: tuple[str, ...]) -> ForceType:
    """A force type with the user's tension of x and v in place of its own, whose whole work is counted as power."""

    def friction(f: object, x: sympy.Expr, v: sympy.Expr, **data: sympy.Expr) -> sympy.Expr:
        return replaced(law, dict(zip(symbols([*LAW, *names]), (x, v, *data.values()), strict=True)))

    data = tuple(f"law.{name}" for name in names)  # a parameter may be called like a scalar
    return ForceType(key=key, vectors=kind.vectors, scalars=kind.scalars, data=data, equation=f"tension {law}", friction=friction)


def _working(components: dict[int, sympy.Expr], scalars: tuple[str, ...]) -> Outputs:
    """Forces by the numbers of their scalars, and their power, which is counted as work."""
    import sympy

    speeds = rates(scalars)
    outputs: Outputs = {TemplateOutput("force", (k,)): expression for k, expression in components.items()}
    return outputs | {TemplateOutput("power"): sympy.Add(*(expression * speeds[k] for k, expression in components.items()))}


def user_force(key: str, scalars: tuple[str, ...], data: tuple[str, ...], components: dict[int, sympy.Expr]) -> Template:
    """A force the user wrote out; components: expression by the number of its scalar."""
    return Template(key=key, equation=USER_FORCE, scalars=scalars, data=data, outputs=_working(components, scalars))


def without_names(template: Template) -> Template:
    """The same with numbers for the names of its scalars and data."""
    scalars, data = tuple(f"x{k}" for k in range(len(template.scalars))), tuple(f"c{k}" for k in range(len(template.data)))
    old = [*symbols(template.scalars), *rates(template.scalars), *symbols(template.data)]
    rules = dict(zip(old, [*symbols(scalars), *rates(scalars), *symbols(data)], strict=True))
    return Template(
        key="user-forces",
        equation=template.equation,
        scalars=scalars,
        data=data,
        outputs={key: replaced(e, rules) for key, e in template.outputs.items()},
    )


def user_potential(key: str, scalars: tuple[str, ...], data: tuple[str, ...], potential: sympy.Expr) -> Template:
    """A potential the user wrote out; its force is the negative gradient, and what it changes by itself in time is power."""
    smooth, whole = _beside_kinks(potential)
    outputs: Outputs = {TemplateOutput("force", (k,)): whole(-smooth.diff(s)) for k, s in enumerate(symbols(scalars))}
    outputs[TemplateOutput("potential")] = potential
    if time() in potential.free_symbols:
        outputs[TemplateOutput("power")] = whole(smooth.diff(time()))
    return Template(key=key, equation="user potential", scalars=scalars, data=data, outputs=outputs)


def _inertia(scalars: tuple[str, ...], kinetic: sympy.Expr, extra: Outputs | None = None) -> Outputs:
    """Outputs from a kinetic energy ½ vᵀMv, a quadratic form of the rates of the scalars; extra: other outputs."""
    speeds = rates(scalars)
    outputs: Outputs = {TemplateOutput("kinetic"): kinetic, **(extra or {})}
    for k, speed in enumerate(speeds):
        momentum = kinetic.diff(speed)
        for l, other in enumerate(speeds):
            outputs[TemplateOutput("mass", (k, l))] = outputs[TemplateOutput("mass", (l, k))] if l < k else momentum.diff(other)
    return outputs


def _derived_mass_diagonal() -> Outputs:
    (v,), (m,) = rates(["x"]), symbols(["m"])
    return _inertia(("x",), m * v**2 / 2)


@cache
def mass_diagonal() -> Template:
    """A constant entry on the diagonal of M."""
    return Template(
        key="mass-diagonal",
        equation="m v^2 / 2",
        scalars=("x",),
        data=("m",),
        outputs=DeferredOutputs(_derived_mass_diagonal),
        is_catalogued=True,
    )


def _derived_mass_pair() -> Outputs:
    (v, w), (m,) = rates(["x", "y"]), symbols(["m"])
    return _inertia(("x", "y"), m * v * w)


@cache
def mass_pair() -> Template:
    """A pair of equal constant entries off the diagonal of M."""
    return Template(
        key="mass-pair", equation="m v w", scalars=("x", "y"), data=("m",), outputs=DeferredOutputs(_derived_mass_pair), is_catalogued=True
    )


def catalogue() -> tuple[Template, ...]:
    """The templates that are the same in all mechanisms and that sympy derives."""
    masses = mass_diagonal(), mass_pair(), weight(), energy_offset(), cross_product_body()
    return (*map(row_template, ROW_TYPES), *masses, *map(force_template, FORCE_TYPES))


def _derived_weight() -> Outputs:
    (x,), (f,) = symbols(["x"]), symbols(["f"])
    return {TemplateOutput("force", (0,)): f, TemplateOutput("potential"): -f * x}


@cache
def weight() -> Template:
    """A constant force along one coordinate, such as gravity: V = −f x."""
    return Template(
        key="weight", equation="-f x", scalars=("x",), data=("f",), outputs=DeferredOutputs(_derived_weight), is_catalogued=True
    )


def _derived_energy_offset() -> Outputs:
    (v,) = symbols(["V"])
    return {TemplateOutput("potential"): v}


@cache
def energy_offset() -> Template:
    """The potential energy of what is fixed."""
    return Template(
        key="energy-offset", equation="V", scalars=(), data=("V",), outputs=DeferredOutputs(_derived_energy_offset), is_catalogued=True
    )


@cache
def cross_product_body() -> Template:
    """The part of M, of the force and of the energies that a third direction w = a × u brings in.

    For a body on two points and a vector (natural coordinates, 2.3): a is the segment, u the vector,
    r the base point; ẇ = ȧ×u + a×u̇ and ẅ = ä×u + a×ü + κ with κ = 2 ȧ×u̇, hence
    Q_in = −(m a₃ κ, z₁₃ κ, z₂₃ κ) − (∂ẇ/∂(ȧ, u̇))ᵀ z₃₃ κ, and gravity pulls at w with the weight g.
    """
    names, data = vector("r") + vector("a") + vector("u"), ("mr", "ma", "mu", "mw", "gx", "gy", "gz")
    derived = DeferredOutputs(partial(_derived_cross_product_body, names))
    return Template(
        key="cross-product-body", equation="kinetic energy of w = a x u", scalars=names, data=data, outputs=derived, is_catalogued=True
    )


def _derived_cross_product_body(names: tuple[str, ...]) -> Outputs:
    """Its outputs over the scalars of r, a and u."""
    import sympy

    a, u = (sympy.Matrix(symbols(vector(n))) for n in "au")
    dr, da, du = (sympy.Matrix(rates(vector(n))) for n in "rau")
    mr, ma, mu, mw = symbols(["mr", "ma", "mu", "mw"])
    g = sympy.Matrix(symbols(["gx", "gy", "gz"]))
    dw = da.cross(u) + a.cross(du)
    momentum = cast("sympy.Matrix", mr * dr + ma * da + mu * du)  # sympy takes it for a number
    kinetic = momentum.dot(dw) + mw * dw.dot(dw) / 2
    kappa = 2 * da.cross(du)
    pull = g - mw * kappa
    outputs: Outputs = {TemplateOutput("potential"): -g.dot(a.cross(u))}
    # virtual power of the pull on w: pull·(δa×u + a×δu) = δa·(u×pull) + δu·(pull×a)
    along = [-mr * kappa, u.cross(pull) - ma * kappa, pull.cross(a) - mu * kappa]
    for k, component in enumerate(c for block in along for c in block):
        outputs[TemplateOutput("force", (k,))] = component
    return _inertia(names, kinetic, outputs)
