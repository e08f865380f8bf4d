"""The two groups of arguments that public functions share: the start of a motion, and the method that computes it.

A function takes them as `**arguments: Unpack[MotionArguments]`. The decorator `takes` checks the names, shows them in `help()` and in
`inspect.signature`, and refuses a wrong name in one sentence everywhere.
"""

from __future__ import annotations

import difflib
import inspect
import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any, TypeAlias, TypedDict, TypeVar, cast

from ncgen.errors import ModelError, given_twice, shown
from ncgen.solver.name_lists import offer

if TYPE_CHECKING:
    from ncgen.methods.own_formalism import OwnFormalism
    from ncgen.solver.argument_checks import ArrayOrNamed
    from ncgen.solver.runs.signals import Signal

CONSISTENT_RESIDUAL = 1e-9
"""Relative residual of the constraints up to which a position is consistent: larger than rounding, smaller than usual tolerances."""

Function = TypeVar("Function", bound=Callable[..., Any])


class StartArguments(TypedDict, total=False):
    """The start of a motion, and what drives it.

    Parameters
    ----------
    q0 : array_like, shape (n,), or {name: value}, optional
        Initial position in m and rad; by name, the other coordinates have the model's values. Default: the model's position. A position
        that is only approximate is assembled first, with a warning. Rows (B, n), or arrays (B,) by name, are a batch, in functions that
        take one.
    zd0 : array_like, shape (nz,), or {name: value}, optional
        Initial velocities of the independent coordinates in m/s and rad/s, as an array in the order of `z`. Default: rest. Rows
        (B, nz), or arrays (B,) by name, are a batch.
    qd0 : array_like, shape (n,), or {name: value}, optional
        Instead of `zd0`, initial velocities of all coordinates, or of any of them by name; the others follow with the least kinetic
        energy. What the constraints do not allow is projected, with a warning. Rows (B, n), or arrays (B,) by name,
        are a batch.
    z : str or iterable of str, optional
        Names of the independent coordinates. Default: the model's choice, else found by pivoting.
    p : array_like, shape (n_p,), or {name: value}, optional
        Parameters. Default: the model's. Rows (B, n_p), or arrays (B,) by name, are a batch.
    t0 : float
        Start time in s.
    closing : float
        Relative residual up to which the start counts as assembled; larger for overconstrained mechanisms with rounded dimensions.
    inputs : {name: signal}, optional
        Signals for the model's inputs: a number; a function of the time (s) that returns one; or a table (times, values) or (times,
        values, hold), where hold is "zero" (the value before holds), "linear" (the default) or "cubic" (a spline). Before and after a
        table its ends hold. Inputs that are not named keep their values in `p`. Steps end where a table jumps or has a corner.
    """

    q0: ArrayOrNamed | None
    zd0: ArrayOrNamed | None
    qd0: ArrayOrNamed | None
    z: str | Iterable[str] | None
    p: ArrayOrNamed | None
    t0: float
    closing: float
    inputs: Mapping[str, Signal] | None


class MethodArguments(TypedDict, total=False):
    """The method that computes a motion.

    Parameters
    ----------
    formalism : str or object
        How accelerations are computed. "auto": ncgen's choice, which `made_with` of the trajectory names, with the reason.
        "coordinate-partitioning" (the paper's Table 8) integrates the independent coordinates. "lagrange" (index 1), "null-space",
        "augmented-lagrangian" (index 1), "udwadia-phohomsiri" and "penalty" integrate all coordinates, and project onto the
        constraints after every step (penalty: Baumgarte's terms). "ali3p" is the index-3 augmented Lagrangian formulation with
        mass-orthogonal projections, by the trapezoidal rule. An object with a `name` and a function `accelerations` is a formalism of
        your own, which runs in Python (docs/methods.md).
    integrator : str
        "auto", dopri5, dop853, rk23, adams, bdf, radau, lsoda, or with the fixed step `max_step` rk4 and trapezoidal; or Matlab's and
        SciPy's names (ode45, RK45, ode113 …). With SUNDIALS (`pip install 'ncgen[sundials]'`) cvode-adams and cvode-bdf, on
        coordinate-partitioning. On "lagrange" also methods that discretise the constrained equations with the fixed step `max_step`:
        rattle (symplectic), energy-momentum (exact energy), generalized-alpha (numerical damping).
    rtol : float
        Relative tolerance, below 1. With a named integrator that of every step. Where the integrator is ncgen's choice, many steps share
        it, so that it bounds the error of the whole run: well-behaved motions end within about 100 `rtol` of their characteristic size.
    atol : float, optional
        Absolute tolerance in m, rad, and per second. Default: a hundredth of `rtol` in the characteristic size of every coordinate.
    max_step : float
        The longest step in s; of methods with a fixed step its length.
    engine : str
        "auto": C where possible; on "lagrange" accelerations by a recursion over the tree of bodies, as code generated for this
        mechanism ("emitted"), or in loops over tables ("tree") for trees without loops that have more than 20 joint velocities. The
        trajectory's `engine` says which it was and why. "c": the whole run in C. "emitted": in C, with a state derivative that is
        generated for this mechanism and its independent coordinates, and compiled, which takes about a second. "refined": the same
        with a step of iterative refinement. "compiled": as "auto", and an error where C is not possible. "python": the reference.
    number : str
        Number type in C: "double", "float" (as in a small controller) or "long double". Tolerances finer than its rounding are raised
        to that. The trajectory always has doubles.
    options : {name: value}, optional
        Options of the formalism and the integrator: stabilisation ("projection", "baumgarte", "none"), omega (1/s) and xi of Baumgarte's
        terms, alpha, the penalty over the largest inertia (ali3p: times h²/4, over that of its tangent); project_velocities of
        energy-momentum; rho, the spectral radius ρ∞ of generalized-alpha, or hht, the α of HHT, in its place.
    """

    formalism: str | OwnFormalism
    integrator: str
    rtol: float | None
    atol: float | None
    max_step: float
    engine: str
    number: str
    options: dict[str, Any] | None


class MotionArguments(StartArguments, MethodArguments, total=False):
    """The start of a motion and the method that computes it: `StartArguments` and `MethodArguments`."""


OneState: TypeAlias = "Sequence[float] | Mapping[str, float]"
"""For type checkers: numbers of one state. They do not know how many dimensions an array has, so a call with one returns `Any` for them."""


class OneStart(TypedDict, total=False):
    """For type checkers: `StartArguments` of one state, of a function that takes the state itself by other names."""

    p: OneState | None
    z: str | Iterable[str] | None
    t0: float
    closing: float
    inputs: Mapping[str, Signal] | None


class OneMotion(OneStart, MethodArguments, total=False):
    """For type checkers: `MotionArguments` of one state."""

    q0: OneState | None
    zd0: OneState | None
    qd0: OneState | None


DEFAULTS: dict[str, Any] = {
    **dict.fromkeys(("q0", "zd0", "qd0", "z", "p", "inputs", "atol", "options")),
    **dict.fromkeys(("formalism", "integrator", "engine"), "auto"),
    **{"t0": 0.0, "closing": CONSISTENT_RESIDUAL, "rtol": 1e-8, "max_step": math.inf, "number": "double"},
}
"""{argument of a group: its value where nothing is given}; functions with other defaults pass them to `takes`."""


def takes(
    group: type, *, unused: Collection[str] = (), former: Mapping[str, str] | None = None, **defaults: object
) -> Callable[[Function], Function]:
    """Let a function take a group of arguments: check their names before the call, and show them in its signature and docstring.

    Parameters
    ----------
    group : type
        The TypedDict of the function's `**arguments`.
    unused : collection of str
        Names of the group that make no difference to this function. A value other than the default is refused.
    former : {str: str}, optional
        {former name of an argument: its name now}; the former name is still accepted.
    **defaults
        Defaults that differ from `DEFAULTS`, for the signature; the function itself applies them.

    Returns
    -------
    callable
        A decorator that keeps the type of the function.
    """

    def decorate(function: Function) -> Function:
        parameters = [p for p in inspect.signature(function).parameters.values() if p.kind is not p.VAR_KEYWORD]
        shared = [word for word in _words(group) if word not in unused and word not in {p.name for p in parameters}]
        known, renamed = dict.fromkeys([p.name for p in parameters] + shared), former or {}

        @wraps(function)
        def checked(*args: Any, **keywords: Any) -> Any:
            if keywords.keys() <= known.keys():
                return function(*args, **keywords)
            return function(*args, **_named(function.__name__, keywords, known, unused, renamed))

        values, kinds = {**DEFAULTS, **defaults}, _words(group)
        more = [inspect.Parameter(word, inspect.Parameter.KEYWORD_ONLY, default=values[word], annotation=kinds[word]) for word in shared]
        vars(checked)["__signature__"] = inspect.signature(function).replace(parameters=[*parameters, *more])
        checked.__doc__ = _with_entries(function.__doc__ or "", group, shared)
        return cast(Function, checked)

    return decorate


def check_names(function: str, names: Iterable[str], known: Collection[str]) -> None:
    """Check the names of arguments.

    Parameters
    ----------
    function : str
        The function's name, for the message.
    names, known : iterable of str
        Names that were given, and names that there are.

    Raises
    ------
    ModelError
        With the nearest name for the first one that is unknown.
    """
    for word in names:
        if word not in known:
            near = difflib.get_close_matches(word, list(known), n=1)
            advice = f"did you mean {near[0]}?" if near else offer(word, sorted(known))
            raise ModelError(f"{function}: there is no argument {shown(word)}; {advice}")


def _named(
    function: str, keywords: dict[str, Any], known: Collection[str], unused: Collection[str], former: Mapping[str, str]
) -> dict[str, Any]:
    """Return arguments by their names of today, without those that make no difference. Raises ModelError for wrong names."""
    for word in [word for word in keywords if word in former]:
        if former[word] in keywords:
            raise given_twice(function, word, former[word])
        keywords[former[word]] = keywords.pop(word)
    keywords = without_unused(function, keywords, unused)
    check_names(function, keywords, known)
    return keywords


def without_unused(function: str, keywords: Mapping[str, Any], unused: Collection[str], where: str = "here") -> dict[str, Any]:
    """Return arguments without those that make no difference; where: in which kind of call, for the message.

    Raises ModelError for a value of one of these that is not its default.
    """
    for word in [word for word in keywords if word in unused]:
        value = keywords[word]
        if value is not None and not (isinstance(value, (str, int, float)) and value == DEFAULTS[word]):
            raise ModelError(f"{function}: {word} is given, and it has no effect {where}; leave it out")
    return {word: value for word, value in keywords.items() if word not in unused}


def _words(group: type) -> dict[str, Any]:
    """Return {name: annotation} of a group."""
    return {word: getattr(kind, "__forward_arg__", kind) for word, kind in group.__annotations__.items()}


def _with_entries(text: str, group: type, words: Collection[str]) -> str:
    """Return a docstring with the entries of a group in place of that of `**arguments`, whose text becomes the notes."""
    text = inspect.cleandoc(text)
    entry = re.search(r"^\*\*\w+ : .*\n((?: +.*\n)*)", text, re.MULTILINE)
    if entry is None:
        return text
    entries = {
        word: block for each in (StartArguments, MethodArguments, group) for word, block in _entries(inspect.getdoc(each) or "").items()
    }
    notes = inspect.cleandoc(f"\n{entry[1]}").strip()
    return f"{text[: entry.start()]}{''.join(entries[word] for word in words)}{text[entry.end() :]}\n\nNotes\n-----\n{notes}\n"


def _entries(text: str) -> dict[str, str]:
    """Return {name: its lines} of the parameters of a docstring in NumPy's style."""
    _, _, section = text.partition("Parameters\n----------\n")
    return {match[1]: match[0] for match in re.finditer(r"^(\w+) : .*\n(?: +.*\n)*", f"{section}\n", re.MULTILINE)}
