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

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple, TypeAlias, cast

import sympy

from ncgen.model.catalogue import ROW_TYPES, RowType
from ncgen.model.elements import AXES, rate_name

TIME = sympy.Symbol("t", real=True)
SCALE = "scale"


class Output(NamedTuple):
    """What an output of a template is: its name, and the numbers of the scalars that it belongs to."""

    name: str
    scalars: tuple[int, ...] = ()


Outputs: TypeAlias = dict[Output, sympy.Expr]


@dataclass(frozen=True, eq=False)
class Template:
    """Outputs as sympy expressions over the symbols of `scalars`, their rates, `data` and time."""

    key: str
    equation: str
    scalars: tuple[str, ...]
    data: tuple[str, ...]
    outputs: Outputs = field(repr=False)


def symbols(names: Iterable[str]) -> list[sympy.Symbol]:
    return [sympy.Symbol(name, real=True) for name in names]


def rates(names: Iterable[str]) -> list[sympy.Symbol]:
    return symbols(map(rate_name, names))


def vector(name: str) -> tuple[str, ...]:
    """The scalar names of a 3-vector argument."""
    return tuple(f"{name}_{axis}" for axis in AXES)


def replaced(expression: sympy.Expr, rules: Mapping[sympy.Symbol, sympy.Expr]) -> sympy.Expr:
    """The expression with others in place of symbols."""
    return cast(sympy.Expr, expression.xreplace(rules))  # sympy says no more than Basic


def differentiate(phi: sympy.Expr, scalars: tuple[str, ...]) -> Outputs:
    """The outputs of a constraint row: Φ, Φ_q, ν = −Φ_t and γ = −(Φ_q q̇)_q q̇ − 2Φ_qt q̇ − Φ_tt.

    γ is the second derivative along the motion that goes on straight: −d²/dε² Φ(q + ε q̇, t + ε) at ε = 0.
    Taken so, the products of Φ stay products; building the Hessian first costs twice the operations.
    """
    x, v = symbols(scalars), rates(scalars)
    smooth, whole = _beside_kinks(phi)
    step = sympy.Dummy("step", real=True)
    moved = {s: s + step * rate for s, rate in zip(x, v, strict=True)} | {TIME: TIME + step}
    curvature = replaced(replaced(smooth, moved).diff(step, 2), {step: sympy.Integer(0)})
    outputs: Outputs = {Output("nu"): -smooth.diff(TIME), Output("gamma"): -curvature}
    outputs.update({Output("phi_q", (k,)): smooth.diff(s) for k, s in enumerate(x)})
    return {Output("phi"): phi, **{key: whole(value) for key, value in outputs.items()}}


def _beside_kinks(expression: sympy.Expr) -> tuple[sympy.Expr, Callable[[sympy.Expr], sympy.Expr]]:
    """The expression with constants for the signs in it, |u| being sign(u) u, and a function that puts the signs back.

    Its derivatives are those beside the kinks, where they are used; sympy's own have Dirac impulses, and derivatives of these.
    """
    signs: dict[sympy.Symbol, sympy.Expr] = {}

    def constant(u: sympy.Expr) -> sympy.Dummy:
        signs[made := sympy.Dummy("sign", real=True)] = sympy.sign(u)
        return made

    def whole(derived: sympy.Expr) -> sympy.Expr:
        for made, sign in reversed(signs.items()):  # outer ones first: their arguments have inner ones
            derived = replaced(derived, {made: sign})
        return derived

    smooth = expression.replace(sympy.Abs, lambda u: constant(u) * u).replace(sympy.sign, constant)
    return (cast(sympy.Expr, smooth), whole) if signs else (expression, lambda derived: derived)  # sympy says no more than Basic


@cache
def row_template(key: str) -> Template:
    """The derivation of one row type of the catalogue."""
    row: RowType = ROW_TYPES[key]
    arguments: dict[str, sympy.Symbol | tuple[sympy.Symbol, ...]] = {name: tuple(symbols(vector(name))) for name in row.vectors}
    arguments |= {name: sympy.Symbol(name, real=True) for name in row.scalars + row.data}
    raw: sympy.Expr = row.formula(sympy, **arguments)
    scalars = sum(map(vector, row.vectors), ()) + row.scalars
    scale = sympy.Symbol(SCALE, real=True)
    outputs = {name: scale * value for name, value in differentiate(raw, scalars).items()}
    return Template(key, row.equation, scalars, row.data + (SCALE,), outputs)


def expression_row_template(key: str, phi: sympy.Expr, scalars: tuple[str, ...], data: tuple[str, ...]) -> Template:
    """A row the user wrote out: its scalars are the coordinates themselves."""
    return Template(key, f"{phi}", scalars, data, differentiate(phi, scalars))


def velocity_row_template(key: str, psi: sympy.Expr, scalars: tuple[str, ...], data: tuple[str, ...]) -> Template:
    """A nonholonomic row the user wrote out, linear in rates: B(q) q̇ = ν stands where Φ_q q̇ = ν does, and Φ = 0.

    γ = −Ḃ q̇ + ν̇. Raises ValueError if the expression is not linear in the rates.
    """
    x, v = symbols(scalars), rates(scalars)
    smooth, whole = _beside_kinks(psi)
    still = dict.fromkeys(v, sympy.Integer(0))
    B = [psi.diff(rate) for rate in v]
    if any(slope.has(*v) for slope in B if v):
        raise ValueError("it is not linear in the rates")
    change = sympy.Add(smooth.diff(TIME), *(smooth.diff(s) * rate for s, rate in zip(x, v, strict=True)))
    outputs: Outputs = {Output("phi"): sympy.Integer(0), Output("nu"): -replaced(psi, still), Output("gamma"): whole(-change)}
    outputs.update({Output("phi_q", (k,)): slope for k, slope in enumerate(B)})
    return Template(key, f"{psi}", scalars, data, outputs)


def _pull(
    key: str,
    equation: str,
    scalars: tuple[str, ...],
    data: tuple[str, ...],
    gradient: Sequence[sympy.Expr | int],
    tension: sympy.Expr,
    potential: sympy.Expr,
    power: sympy.Expr,
) -> Template:
    """A force −tension along the gradient of a length or angle."""
    outputs: Outputs = {Output("force", (k,)): -tension * slope for k, slope in enumerate(gradient)}
    outputs |= {Output("potential"): potential, Output("power"): power}
    return Template(key, equation, scalars, data, outputs)


@cache
def spring() -> Template:
    """Spring and damper along a segment a of length L: tension k (L − L0) + c L̇."""
    a, da = symbols(vector("a")), rates(vector("a"))
    k, c, free = symbols(SPRING_DATA)
    L = sympy.sqrt(sum(x * x for x in a))
    rate = sum(x * v for x, v in zip(a, da, strict=True)) / L
    tension = k * (L - free) + c * rate
    gradient = [x / L for x in a]
    equation = "k (|a| - L0)^2 / 2, damper c"
    return _pull("spring", equation, vector("a"), SPRING_DATA, gradient, tension, k * (L - free) ** 2 / 2, -c * rate**2)


@cache
def spring_to_nothing() -> Template:
    """The same with free length 0: the force −k a is regular where the ends meet; only the damper needs a direction."""
    a, da = symbols(vector("a")), rates(vector("a"))
    k, c, _ = symbols(SPRING_DATA)
    squared, closing = sum(x * x for x in a), sum(x * v for x, v in zip(a, da, strict=True))
    outputs: Outputs = {Output("force", (i,)): -k * x - c * closing / squared * x for i, x in enumerate(a)}
    outputs |= {Output("potential"): k * squared / 2, Output("power"): -c * closing**2 / squared}
    return Template("spring-to-nothing", "k |a|^2 / 2, damper c", vector("a"), SPRING_DATA, outputs)


@cache
def torsion_spring() -> Template:
    """Spring and damper along a relative coordinate x."""
    (x,), (v,) = symbols(["x"]), rates(["x"])
    k, c, free = symbols(SPRING_DATA)
    tension = k * (x - free) + c * v
    return _pull("torsion-spring", "k (x - x0)^2 / 2, damper c", ("x",), SPRING_DATA, [1], tension, k * (x - free) ** 2 / 2, -c * v**2)


def spring_law(key: str, law: sympy.Expr, along_segment: bool, data: tuple[str, ...]) -> Template:
    """A spring with the user's law of x and v (its whole work is counted as power)."""
    scalars = vector("a") if along_segment else ("x",)
    s, ds = symbols(scalars), rates(scalars)
    x = sympy.sqrt(sum(c * c for c in s)) if along_segment else s[0]
    v = sum(c * d for c, d in zip(s, ds, strict=True)) / x if along_segment else ds[0]
    named = tuple(f"law.{name}" for name in data)  # a parameter may be called like a scalar
    tension = replaced(law, dict(zip(symbols(["x", "v", *data]), (x, v, *symbols(named)), strict=True)))
    gradient = [c / x for c in s] if along_segment else [1]
    return _pull(key, f"tension {law}", scalars, named, gradient, tension, sympy.Integer(0), -tension * v)


SPRING_DATA = ("k", "c", "L0")


@cache
def couple() -> Template:
    """A couple n on a body with directions x1, x2, x3 of volume V: force ½ n × xᵏ along direction k.

    xᵏ is the reciprocal basis, so the power is n·ω with ω = ½ Σ xᵏ × ẋ_k (natural coordinates, 2.5).
    """
    names = vector("x1") + vector("x2") + vector("x3")
    x = [sympy.Matrix(symbols(vector(f"x{k}"))) for k in (1, 2, 3)]
    v = [sympy.Matrix(rates(vector(f"x{k}"))) for k in (1, 2, 3)]
    n, (volume,) = sympy.Matrix(symbols(["nx", "ny", "nz"])), symbols(["V"])
    force = [cast(sympy.Matrix, n.cross(x[(k + 1) % 3].cross(x[(k + 2) % 3])) / (2 * volume)) for k in range(3)]  # sympy does not say
    outputs: Outputs = {Output("force", (3 * k + i,)): force[k][i] for k in range(3) for i in range(3)}
    outputs[Output("power")] = sum((f.dot(rate) for f, rate in zip(force, v, strict=True)), sympy.Integer(0))
    return Template("couple", "n x reciprocal basis / 2", names, ("nx", "ny", "nz", "V"), outputs)


def force_template(key: str, scalars: tuple[str, ...], data: tuple[str, ...], components: dict[int, sympy.Expr]) -> Template:
    """A force the user wrote out; components: expression by the number of its scalar. Its power is counted as work."""
    speeds = rates(scalars)
    outputs: Outputs = {Output("force", (k,)): expression for k, expression in components.items()}
    outputs[Output("power")] = sympy.Add(*(expression * speeds[k] for k, expression in components.items()))
    return Template(key, "user force", scalars, data, outputs)


def potential_template(key: str, scalars: tuple[str, ...], data: tuple[str, ...], potential: sympy.Expr) -> Template:
    """A potential the user wrote out; its force is the negative gradient, and what it changes by itself in time is power."""
    smooth, whole = _beside_kinks(potential)
    outputs: Outputs = {Output("force", (k,)): whole(-smooth.diff(s)) for k, s in enumerate(symbols(scalars))}
    outputs[Output("potential")] = potential
    if TIME in potential.free_symbols:
        outputs[Output("power")] = whole(smooth.diff(TIME))
    return Template(key, "user potential", scalars, data, outputs)


def _inertia(
    key: str, equation: str, scalars: tuple[str, ...], data: tuple[str, ...], kinetic: sympy.Expr, more: Outputs | None = None
) -> Template:
    """A template from its kinetic energy ½ vᵀMv, a quadratic form of the rates; more: its other outputs."""
    speeds = rates(scalars)
    outputs: Outputs = {Output("kinetic"): kinetic, **(more or {})}
    for k, speed in enumerate(speeds):
        momentum = kinetic.diff(speed)
        for l, other in enumerate(speeds):
            outputs[Output("mass", (k, l))] = momentum.diff(other)
    return Template(key, equation, scalars, data, outputs)


@cache
def mass_diagonal() -> Template:
    """A constant entry on the diagonal of M."""
    (v,), (m,) = rates(["x"]), symbols(["m"])
    return _inertia("mass-diagonal", "m v^2 / 2", ("x",), ("m",), m * v**2 / 2)


@cache
def mass_pair() -> Template:
    """A pair of equal constant entries off the diagonal of M."""
    (v, w), (m,) = rates(["x", "y"]), symbols(["m"])
    return _inertia("mass-pair", "m v w", ("x", "y"), ("m",), m * v * w)


@cache
def weight() -> Template:
    """A constant force along one coordinate, such as gravity: V = −f x."""
    (x,), (f,) = symbols(["x"]), symbols(["f"])
    return Template("weight", "-f x", ("x",), ("f",), {Output("force", (0,)): f, Output("potential"): -f * x})


@cache
def energy_offset() -> Template:
    """The potential energy of what is fixed."""
    (v,) = symbols(["V"])
    return Template("energy-offset", "V", (), ("V",), {Output("potential"): v})


@cache
def cross_product_body() -> Template:
    """The part of M, of the force and of the energies that a third direction w = a × u brings in.

    For a body on two points and a vector (natural coordinates, 2.3): a is the segment, u the vector,
    r the base point; ẇ = ȧ×u + a×u̇ and ẅ = ä×u + a×ü + κ with κ = 2 ȧ×u̇, hence
    Q_in = −(m a₃ κ, z₁₃ κ, z₂₃ κ) − (∂ẇ/∂(ȧ, u̇))ᵀ z₃₃ κ, and gravity pulls at w with the weight g.
    """
    names = vector("r") + vector("a") + vector("u")
    a, u = (sympy.Matrix(symbols(vector(n))) for n in "au")
    dr, da, du = (sympy.Matrix(rates(vector(n))) for n in "rau")
    mr, ma, mu, mw = symbols(["mr", "ma", "mu", "mw"])
    g = sympy.Matrix(symbols(["gx", "gy", "gz"]))
    dw = da.cross(u) + a.cross(du)
    momentum = cast(sympy.Matrix, mr * dr + ma * da + mu * du)  # sympy takes it for a number
    kinetic = momentum.dot(dw) + mw * dw.dot(dw) / 2
    kappa = 2 * da.cross(du)
    pull = g - mw * kappa
    outputs: Outputs = {Output("potential"): -g.dot(a.cross(u))}
    # virtual power of the pull on w: pull·(δa×u + a×δu) = δa·(u×pull) + δu·(pull×a)
    along = [-mr * kappa, u.cross(pull) - ma * kappa, pull.cross(a) - mu * kappa]
    for k, component in enumerate(c for block in along for c in block):
        outputs[Output("force", (k,))] = component
    return _inertia(
        "cross-product-body",
        "kinetic energy of w = a x u",
        names,
        ("mr", "ma", "mu", "mw", "gx", "gy", "gz"),
        kinetic,
        outputs,
    )
