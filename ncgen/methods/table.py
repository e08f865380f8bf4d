"""Every formalism and integrator: one entry each.

The numbers in C, what goes with what, refusals, help texts and tables of the documentation come from here. What an entry computes
stands elsewhere, under its name: explicit methods, entry and all, in `ncgen.methods.explicit`, the others in `ncgen.solver` and in the C
runtime.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from numbers import Real
from typing import TYPE_CHECKING, Any, TypeGuard, cast

from ncgen.errors import MAX_ECHO, ModelError, one_of, shortened, shown, unknown_word
from ncgen.methods.explicit import EXPLICIT, Published
from ncgen.methods.own_formalism import OwnFormalism, check_own, is_own

if TYPE_CHECKING:
    from ncgen.methods.tableau import Tableau

AUTO = "auto"
"""The name under which the choice is left to ncgen."""

STABILISATIONS = ("projection", "baumgarte", "none")

OF_SCIPY = ("rk23", "dopri5", "dop853")
"""Explicit methods with error control that SciPy has, too."""

LIMITS = {"rho": 1.0, "hht": 1 / 3}
"""Options that end somewhere; the others are numbers from 0 on."""


@dataclass(frozen=True, kw_only=True)
class Integrator:
    """A way to advance a state.

    help: one line; also: SciPy's and Matlab's names; extra: what `pip install 'ncgen[…]'` has to bring
    has_fixed_step: its step is max_step; else rtol and atol choose it
    takes_jacobian: it solves equations with the Jacobian of the state derivative
    tangents: whether it needs the tangent kernels in C: "never", "always", "sometimes", where it can do without them in simple mechanisms,
        or "unless_recursive", where a recursion over the tree of bodies gives the accelerations of Lagrange's equations instead
    steps: formalisms whose constrained equations it discretises itself; is_ordinary: it also takes a state derivative
    keeps_history: its state cannot be corrected between steps, so it goes with coordinate partitioning alone
    in_c, in_lanes, in_python: it runs in the C runtime; also for many states at a time; with the reference in Python
    tableau: as it was published, for explicit Runge-Kutta methods of the runtime
    options: what may be set where it steps the constraints, with defaults
    """

    name: str
    help: str
    also: tuple[str, ...] = ()
    extra: str = ""
    has_fixed_step: bool = False
    takes_jacobian: bool = False
    tangents: str = "never"
    steps: tuple[str, ...] = ()
    is_ordinary: bool = True
    keeps_history: bool = False
    in_c: bool = False
    in_lanes: bool = False
    in_python: bool = True
    tableau: Published | None = None
    options: dict[str, Any] = field(default_factory=dict, hash=False)

    @cached_property
    def coefficients(self) -> Tableau:
        """The Tableau of an explicit Runge-Kutta method; reading it checks it."""
        from ncgen.methods.tableau import Tableau

        if self.tableau is None:
            raise AttributeError(f"{self.name} is no explicit Runge-Kutta method")
        return Tableau.of(self.tableau)

    @property
    def step_in_c(self) -> tuple[str, str] | None:
        """The functions in C that take a step of a method that discretises the constrained equations, without tangents and with."""
        word = f"ncgen_{self.name.replace('-', '_')}"
        if self.is_ordinary or not self.in_c:
            return None
        return word, word if self.tangents == "always" else f"{word}_with_tangents"

    @property
    def takes_recursion(self) -> bool:
        """True if a recursion over the tree of bodies serves it as state derivative in C."""
        return self.tableau is not None or self.tangents == "unless_recursive"

    @property
    def constant(self) -> str:
        """Its name in C."""
        return _constant(self.name)


@dataclass(frozen=True, kw_only=True)
class Formalism:
    """Where accelerations come from.

    is_constrained: all coordinates are integrated, not the independent ones alone; is_ordinary: it has a state derivative that
        ordinary integrators take
    options: what may be set, with defaults; own: the user's object that computes the accelerations, None for ncgen's formalisms
    """

    name: str
    help: str
    is_constrained: bool = True
    is_ordinary: bool = True
    in_c: bool = True
    options: dict[str, Any] = field(default_factory=dict, hash=False)
    user_object: OwnFormalism | None = field(default=None, hash=False)

    @property
    def constant(self) -> str:
        """Its name in C."""
        return _constant(self.name)


def is_real(value: object) -> TypeGuard[float]:
    """True for a real number of any kind, NumPy's and fractions included: it compares with others like a float."""
    return type(value) is float or isinstance(value, Real)  # the second takes ten times as long


def _constant(name: str) -> str:
    return f"NCGEN_{name.upper().replace('-', '_')}"


def _explicit(name: str, tableau: Published) -> Integrator:
    is_fixed = not tableau.errors and not tableau.ends
    in_python = is_fixed or name in OF_SCIPY
    return Integrator(
        name=name,
        help=tableau.help,
        also=tableau.also,
        has_fixed_step=is_fixed,
        in_c=True,
        in_lanes=True,
        in_python=in_python,
        tableau=tableau,
    )


def _stepper(name: str, help: str, tangents: str, options: dict[str, Any] | None = None) -> Integrator:
    return Integrator(
        name=name,
        help=help,
        has_fixed_step=True,
        is_ordinary=False,
        steps=("lagrange",),
        in_c=True,
        in_python=False,
        tangents=tangents,
        options=options or {},
    )


INTEGRATORS = {
    entry.name: entry
    for entry in (
        *(_explicit(name, tableau) for name, tableau in EXPLICIT.items()),
        _stepper("rattle", "RATTLE, symplectic, order 2", tangents="sometimes"),
        _stepper("energy-momentum", "exact energy, order 2", tangents="sometimes", options={"project_velocities": False}),
        Integrator(
            name="radau",
            help="Radau IIA of order 5, implicit, for stiff mechanisms",
            takes_jacobian=True,
            tangents="unless_recursive",
            in_c=True,
        ),
        Integrator(
            name="trapezoidal", help="the trapezoidal rule, implicit, order 2, fixed step", has_fixed_step=True, takes_jacobian=True,
            tangents="always", in_c=True, in_python=False, steps=("ali3p",), options={"alpha": 1e7},
        ),
        _stepper("generalized-alpha", "generalised α, numerical damping, order 2", tangents="always", options={"rho": 0.8, "hht": None}),
        Integrator(name="adams", help="Adams methods of variable order (VODE)", also=("ode113",)),
        Integrator(name="bdf", help="backward differentiation of variable order, implicit (SciPy)", also=("ode15s",), takes_jacobian=True),
        Integrator(name="lsoda", help="Adams or BDF as stiffness demands (SciPy)", takes_jacobian=True),
        Integrator(name="cvode-adams", help="Adams methods of SUNDIALS", extra="sundials", keeps_history=True),
        Integrator(name="cvode-bdf", help="BDF of SUNDIALS", extra="sundials", keeps_history=True, takes_jacobian=True),
    )
}  # fmt: skip
"""By name, in the order of their numbers in C."""


def _of_accelerations(name: str, help: str, stabilisation: str = "projection", is_ordinary: bool = True, **defaults: float) -> Formalism:
    """A formalism over all coordinates."""
    return Formalism(
        name=name, help=help, is_ordinary=is_ordinary, options={"stabilisation": stabilisation, "omega": 10.0, "xi": 1.0, **defaults}
    )


FORMALISMS = {
    entry.name: entry
    for entry in (
        Formalism(
            name="coordinate-partitioning",
            help="the independent coordinates alone are integrated (the paper's Table 8)",
            is_constrained=False,
        ),
        _of_accelerations("lagrange", "accelerations and multipliers at once, index 1"),
        _of_accelerations("augmented-lagrangian", "the same by iteration with a penalty", alpha=1e7),
        _of_accelerations("penalty", "forces of a penalty in place of constraints", stabilisation="baumgarte", alpha=1e7),
        _of_accelerations("null-space", "accelerations on a basis of the allowed motions"),
        _of_accelerations("udwadia-phohomsiri", "accelerations of least squares"),
        _of_accelerations("ali3p", "index-3 augmented Lagrangian with projections", is_ordinary=False),
    )
}
"""By name, in the order of their numbers in C."""


def number_in_c(entry: Integrator | Formalism) -> int:
    """The number of an entry in the runtime's enumerations; for entries that are in C."""
    return _numbers_in_c(isinstance(entry, Integrator))[entry.name]


@cache
def _numbers_in_c(of_integrators: bool) -> dict[str, int]:
    return {name: number for number, name in enumerate(in_c(INTEGRATORS if of_integrators else FORMALISMS))}


def in_c(table: Mapping[str, Integrator | Formalism]) -> tuple[str, ...]:
    """Names of the entries of a table that run in C."""
    return tuple(name for name, entry in table.items() if entry.in_c)


@cache
def other_names() -> dict[str, str]:
    """{name of SciPy or Matlab: ours}."""
    return {other: entry.name for entry in INTEGRATORS.values() for other in entry.also}


def find_integrator(name: object) -> Integrator:
    """The integrator of any of its names, upper or lower case. Raises ModelError listing the known ones."""
    key = name.lower() if isinstance(name, str) else ""
    key = other_names().get(key, key)
    if key not in INTEGRATORS:
        raise unknown_word(name, "integrator", (AUTO, *INTEGRATORS, *other_names()))
    return INTEGRATORS[key]


def find_formalism(name: object) -> Formalism:
    """The formalism of a name, the entry of a user's own object, or an entry itself. Raises ModelError listing the known ones."""
    if isinstance(name, Formalism):
        return name
    if is_own(name):
        check_own(name, (AUTO, *FORMALISMS))
        user_object = cast(OwnFormalism, name)
        return replace(_of_accelerations(user_object.name, "the user's own"), in_c=False, user_object=user_object)
    if not isinstance(name, str) or name not in FORMALISMS:
        raise unknown_word(name, "formalism", (AUTO, *FORMALISMS))
    return FORMALISMS[name]


def goes_with(formalism: Formalism, integrator: Integrator) -> bool:
    """True if a formalism and an integrator make a method."""
    if formalism.name in integrator.steps:
        return True
    if not (formalism.in_c or integrator.in_python):
        return False
    return formalism.is_ordinary and integrator.is_ordinary and not (formalism.is_constrained and integrator.keeps_history)


def partners(entry: Integrator | Formalism) -> tuple[str, ...]:
    """Names of the integrators that go with a formalism, or of the formalisms that go with an integrator."""
    if isinstance(entry, Formalism):
        return tuple(i.name for i in INTEGRATORS.values() if goes_with(entry, i))
    return tuple(f.name for f in FORMALISMS.values() if goes_with(f, entry))


def check_pair(formalism: Formalism, integrator: Integrator) -> None:
    """Raise ModelError, naming what goes with each, where the two are no method."""
    if not goes_with(formalism, integrator):
        raise ModelError(
            f"{integrator.name} does not go with {formalism.name}: {formalism.name} goes with {', '.join(partners(formalism))}; "
            f"{integrator.name} goes with {', '.join(partners(integrator))}"
        )


def steps_constraints(formalism: Formalism, integrator: Integrator) -> bool:
    """True if the integrator discretises the constrained equations themselves."""
    return formalism.name in integrator.steps


def options_of(formalism: Formalism, integrator: Integrator, options: dict[str, Any] | None) -> dict[str, Any]:
    """The defaults of a method with the caller's options in their place. Raises ModelError for unknown or impossible ones."""
    defaults = integrator.options if steps_constraints(formalism, integrator) else formalism.options
    if not isinstance(options, dict | None):
        raise ModelError(f"options: {shown(options)} given; give a dictionary {{name: value}}")
    for name, value in (options or {}).items():
        if name not in defaults:
            method = f"{formalism.name} with {integrator.name}"
            raise ModelError(f"option {_text(name)}: {method} has no such option; it has {', '.join(defaults) or 'none'}")
        _check_option(name, value, defaults[name])
    return {**defaults, **(options or {})}


def _check_option(name: str, value: object, default: object) -> None:
    if name == "stabilisation":
        one_of(value, "stabilisation", STABILISATIONS)
    elif isinstance(default, bool):
        if not isinstance(value, bool):
            raise ModelError(f"option {name}: {shown(value)} given; it must be True or False")
    elif value is None and default is None:
        return
    elif isinstance(value, bool) or not is_real(value) or not 0 <= value <= LIMITS.get(name, sys.float_info.max):
        wanted = f"from 0 to {LIMITS[name]:.3g}" if name in LIMITS else "from 0 on"
        raise ModelError(f"option {name}: {_text(value)} given; it must be a number {wanted}")


def _text(value: object) -> str:
    """What was given, a text without its quotation marks."""
    return shortened(value, MAX_ECHO) if isinstance(value, str) else shown(value)
