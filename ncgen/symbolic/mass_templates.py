"""Templates of inertia and weight: constant entries of M, and what a third direction of a body contributes."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import TYPE_CHECKING, cast

from ncgen.symbolic.templates import DeferredOutputs, Outputs, Template, TemplateOutput, rates, symbols, vector

if TYPE_CHECKING:
    import sympy


def _inertia(scalars: tuple[str, ...], kinetic: sympy.Expr, extra: Outputs | None = None) -> Outputs:
    """Outputs from a kinetic energy ½ vᵀMv, a quadratic form of the rates of the scalars; extra: other outputs."""
    speeds = rates(scalars)
    outputs: Outputs = {TemplateOutput("kinetic"): kinetic, **(extra or {})}
    for k, speed in enumerate(speeds):
        momentum = kinetic.diff(speed)
        for l, other in enumerate(speeds):
            outputs[TemplateOutput("mass", (k, l))] = outputs[TemplateOutput("mass", (l, k))] if l < k else momentum.diff(other)
    return outputs


def _template(key: str, equation: str, scalars: tuple[str, ...], data: tuple[str, ...], outputs: Callable[[], Outputs]) -> Template:
    """A template of the catalogue; outputs: a function of a module, which can be pickled, for when they are asked for."""
    return Template(key=key, equation=equation, scalars=scalars, data=data, outputs=DeferredOutputs(outputs), is_catalogued=True)


def _derived_mass_diagonal() -> Outputs:
    (v,), (m,) = rates(["x"]), symbols(["m"])
    return _inertia(("x",), m * v**2 / 2)


@cache
def mass_diagonal() -> Template:
    """A constant entry on the diagonal of M."""
    return _template("mass-diagonal", "m v^2 / 2", ("x",), ("m",), _derived_mass_diagonal)


def _derived_mass_pair() -> Outputs:
    (v, w), (m,) = rates(["x", "y"]), symbols(["m"])
    return _inertia(("x", "y"), m * v * w)


@cache
def mass_pair() -> Template:
    """A pair of equal constant entries off the diagonal of M."""
    return _template("mass-pair", "m v w", ("x", "y"), ("m",), _derived_mass_pair)


def _derived_weight() -> Outputs:
    (x,), (f,) = symbols(["x"]), symbols(["f"])
    return {TemplateOutput("force", (0,)): f, TemplateOutput("potential"): -f * x}


@cache
def weight() -> Template:
    """A constant force along one coordinate, such as gravity: V = −f x."""
    return _template("weight", "-f x", ("x",), ("f",), _derived_weight)


def _derived_energy_offset() -> Outputs:
    (v,) = symbols(["V"])
    return {TemplateOutput("potential"): v}


@cache
def energy_offset() -> Template:
    """The potential energy of what is fixed."""
    return _template("energy-offset", "V", (), ("V",), _derived_energy_offset)


@cache
def cross_product_body() -> Template:
    """The part of M, of the force and of the energies that a third direction w = a × u brings in.

    For a body on two points and a vector (natural coordinates, 2.3): a is the segment, u the vector,
    r the base point; ẇ = ȧ×u + a×u̇ and ẅ = ä×u + a×ü + κ with κ = 2 ȧ×u̇, hence
    Q_in = −(m a₃ κ, z₁₃ κ, z₂₃ κ) − (∂ẇ/∂(ȧ, u̇))ᵀ z₃₃ κ, and gravity pulls at w with the weight g.
    """
    names, data = vector("r") + vector("a") + vector("u"), ("mr", "ma", "mu", "mw", "gx", "gy", "gz")
    return _template("cross-product-body", "kinetic energy of w = a x u", names, data, partial(_derived_cross_product_body, names))


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
