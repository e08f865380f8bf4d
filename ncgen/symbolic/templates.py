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

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING, NamedTuple, TypeAlias, cast

from ncgen.model.catalogue import ROW_TYPES, RowType
from ncgen.model.elements import AXES, rate_name
from ncgen.model.names import TIME

if TYPE_CHECKING:
    import sympy

SCALE = "scale"


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
    smooth, whole = beside_kinks(phi)
    step = sympy.Dummy("step", real=True)
    moved = {s: s + step * rate for s, rate in zip(x, v, strict=True)} | {time(): time() + step}
    curvature = replaced(replaced(smooth, moved).diff(step, 2), {step: sympy.Integer(0)})
    outputs: Outputs = {TemplateOutput("nu"): -smooth.diff(time()), TemplateOutput("gamma"): -curvature}
    outputs.update({TemplateOutput("phi_q", (k,)): smooth.diff(s) for k, s in enumerate(x)})
    return {TemplateOutput("phi"): phi, **{key: whole(value) for key, value in outputs.items()}}


def beside_kinks(expression: sympy.Expr) -> tuple[sympy.Expr, Callable[[sympy.Expr], sympy.Expr]]:
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
    smooth, whole = beside_kinks(psi)
    still = dict.fromkeys(v, sympy.Integer(0))
    B = [psi.diff(rate) for rate in v]
    if any(derivative.has(*v) for derivative in B if v):
        raise ValueError("it is not linear in the rates")
    change = sympy.Add(smooth.diff(time()), *(smooth.diff(s) * rate for s, rate in zip(x, v, strict=True)))
    outputs: Outputs = {
        TemplateOutput("phi"): sympy.Integer(0),
        TemplateOutput("nu"): -replaced(psi, still),
        TemplateOutput("gamma"): whole(-change),
    }
    outputs.update({TemplateOutput("phi_q", (k,)): derivative for k, derivative in enumerate(B)})
    return Template(key=key, equation=f"{psi}", scalars=scalars, data=data, outputs=outputs)
