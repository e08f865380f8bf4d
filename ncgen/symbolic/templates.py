"""Templates: what a kind of row, mass or force contributes, derived once with sympy.

A template is written over *scalars* (each a linear form of coordinates, such as the x of a segment),
their rates, time, and *data* (constants or parameters). Its outputs say how it enters the equations:

    "phi", "nu", "gamma"        a constraint row
    ("phi_q", k)                the row's derivative by scalar k
    ("mass", k, l)              mass between scalars k and l
    ("force", k)                generalised force along scalar k
    "kinetic", "potential", "power"   energy (J), and the power (W) of forces without a potential

Where scalars are combined from coordinates, the chain rule is applied later, on programs; so one
derivation serves every mechanism and every pattern of fixed and free coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import sympy

from ncgen.model.catalogue import ROW_TYPES, RowType
from ncgen.model.elements import AXES, rate_name

TIME = sympy.Symbol("t", real=True)
SCALE = "scale"


@dataclass(frozen=True, eq=False)
class Template:
    """Outputs as sympy expressions over the symbols of `scalars`, their rates, `data` and time."""

    key: str
    equation: str
    scalars: tuple[str, ...]
    data: tuple[str, ...]
    outputs: dict[object, sympy.Expr] = field(repr=False)


def symbols(names) -> list[sympy.Symbol]:
    return [sympy.Symbol(name, real=True) for name in names]


def rates(names) -> list[sympy.Symbol]:
    return symbols(map(rate_name, names))


def vector(name: str) -> tuple[str, ...]:
    """The scalar names of a 3-vector argument."""
    return tuple(f"{name}_{axis}" for axis in AXES)


def differentiate(phi: sympy.Expr, scalars: tuple[str, ...]) -> dict[object, sympy.Expr]:
    """The outputs of a constraint row: Φ, Φ_q, ν = −Φ_t and γ = −(Φ_q q̇)_q q̇ − 2Φ_qt q̇ − Φ_tt.

    γ is the second derivative along the motion that goes on straight: −d²/dε² Φ(q + ε q̇, t + ε) at ε = 0.
    Taken so, the products of Φ stay products; building the Hessian first costs twice the operations.
    """
    x, v = symbols(scalars), rates(scalars)
    step = sympy.Dummy("step")
    moved = {s: s + step * rate for s, rate in zip(x, v, strict=True)} | {TIME: TIME + step}
    curvature = phi.xreplace(moved).diff(step, 2).xreplace({step: sympy.Integer(0)})
    outputs = {"phi": phi, "nu": -phi.diff(TIME), "gamma": -curvature}
    outputs.update({("phi_q", k): phi.diff(s) for k, s in enumerate(x)})
    return outputs


@cache
def row_template(key: str) -> Template:
    """The derivation of one row type of the catalogue."""
    row: RowType = ROW_TYPES[key]
    arguments = {name: tuple(symbols(vector(name))) for name in row.vectors}
    arguments |= {name: sympy.Symbol(name, real=True) for name in row.scalars + row.data}
    raw = row.formula(sympy, **arguments)
    scalars = sum(map(vector, row.vectors), ()) + row.scalars
    scale = sympy.Symbol(SCALE, real=True)
    outputs = {name: scale * value for name, value in differentiate(raw, scalars).items()}
    return Template(key, row.equation, scalars, row.data + (SCALE,), outputs)


def expression_row_template(key: str, phi: sympy.Expr, scalars: tuple[str, ...], data: tuple[str, ...]) -> Template:
    """A row the user wrote out: its scalars are the coordinates themselves."""
    return Template(key, f"{phi}", scalars, data, differentiate(phi, scalars))


def force_template(key: str, scalars: tuple[str, ...], data: tuple[str, ...], components: dict[int, sympy.Expr]) -> Template:
    """A force the user wrote out; components: expression by the number of its scalar. Its power is counted as work."""
    speeds = rates(scalars)
    outputs = {("force", k): expression for k, expression in components.items()}
    outputs["power"] = sympy.Add(*(expression * speeds[k] for k, expression in components.items()))
    return Template(key, "user force", scalars, data, outputs)


def potential_template(key: str, scalars: tuple[str, ...], data: tuple[str, ...], potential: sympy.Expr) -> Template:
    """A potential the user wrote out; its force is the negative gradient."""
    outputs = {("force", k): -potential.diff(s) for k, s in enumerate(symbols(scalars))}
    outputs["potential"] = potential
    return Template(key, "user potential", scalars, data, outputs)


def _inertia(key, equation, scalars, data, kinetic, **more) -> Template:
    """A template from its kinetic energy ½ vᵀMv, a quadratic form of the rates."""
    speeds = rates(scalars)
    outputs = {"kinetic": kinetic, **more.pop("outputs", {})}
    for k, speed in enumerate(speeds):
        momentum = kinetic.diff(speed)
        for l, other in enumerate(speeds):
            outputs["mass", k, l] = momentum.diff(other)
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
    return Template("weight", "-f x", ("x",), ("f",), {("force", 0): f, "potential": -f * x})


@cache
def energy_offset() -> Template:
    """The potential energy of what is fixed."""
    (v,) = symbols(["V"])
    return Template("energy-offset", "V", (), ("V",), {"potential": v})


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
    kinetic = (mr * dr + ma * da + mu * du).dot(dw) + mw * dw.dot(dw) / 2
    kappa = 2 * da.cross(du)
    pull = g - mw * kappa
    outputs = {"potential": -g.dot(a.cross(u))}
    # virtual power of the pull on w: pull·(δa×u + a×δu) = δa·(u×pull) + δu·(pull×a)
    along = [-mr * kappa, u.cross(pull) - ma * kappa, pull.cross(a) - mu * kappa]
    for k, component in enumerate(c for block in along for c in block):
        outputs["force", k] = component
    return _inertia(
        "cross-product-body",
        "kinetic energy of w = a x u",
        names,
        ("mr", "ma", "mu", "mw", "gx", "gy", "gz"),
        kinetic,
        outputs=outputs,
    )
