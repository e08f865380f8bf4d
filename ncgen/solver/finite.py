"""NaN and infinity: detected where they arise, and reported by their owner's name.

Kernels add up what many terms give, so that one term which is not a number makes all that is computed from it no number
either. The solver therefore looks at what the kernels return (`watched`), and where that is not finite evaluates the terms
one by one. A term may leave its domain in a stage that is only tried; the engines repeat such a step with a shorter one, and
tell the owner where that does not help.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ncgen.errors import DomainError, ModelError, NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.values import Symbolic

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from ncgen.program.kernel_table import Kernel
    from ncgen.symbolic.numbering import Terms
    from ncgen.symbolic.term import Term

POSITION, VELOCITY = ("q", "t", "p"), ("q", "qd", "t", "p")

CHECKED_KERNELS = {
    "phi": ("phi", POSITION),
    "phi_q": ("phi_q", POSITION),
    "jacobian": ("phi_q", POSITION),
    "nu": ("nu", POSITION),
    "mass": ("mass", POSITION),
    "mass_matrix": ("mass", POSITION),
    "gamma": ("gamma", VELOCITY),
    "force": ("force", VELOCITY),
    "energy": ("energy", VELOCITY),
    "stiffness": ("stiffness", ("q", "qd", "qdd", "lam", "t", "p")),
    "damping": ("damping", VELOCITY),
    "phidd_q": ("phidd_q", ("q", "qd", "qdd", "t", "p")),
    "phidd_qd": ("phidd_qd", VELOCITY),
}
"""What is looked at: the method of `Kernels`, the kernel behind it, and its arguments."""

DERIVED = {
    "phi_q": "the derivative of ",
    "nu": "the rate of ",
    "gamma": "the acceleration of ",
    "energy": "the energy of ",
    "stiffness": "the derivative of ",
    "damping": "the derivative of ",
    "phidd_q": "the derivative of ",
    "phidd_qd": "the derivative of ",
}
"""Words for what a kernel makes of a term; of the others it is the term itself."""

KERNELS_IN_ORDER = ("phi", "phi_q", "nu", "mass", "gamma", "force", "energy")
"""The kernels of an instant, those first that the others follow."""

STEP_FRACTIONS = (0.0, 1.0, 0.5, 0.25, 2.0, 4.0)
"""Where a step that failed is looked at, as shares of how far it was tried."""

TIME_FRACTION = 1e-9
"""And at this share of the time: a run that comes nearer and nearer to where a term ends is stuck a few roundings before."""

MAX_NAMED_NUMBERS = 3
"""How many numbers a sentence gives of where it happened."""

REMEDY = "correct the expression, or start and move where it is defined"


def is_finite(values: np.ndarray | csr_array) -> bool:
    """True if no number is infinite or NaN. The sum of their squares tells it in nearly all cases, and takes a third of the time."""
    numbers = values if isinstance(values, np.ndarray) else values.data
    return math.isfinite(np.vdot(numbers, numbers)) or bool(np.all(np.isfinite(numbers)))


class FiniteKernels:
    """The kernels of a mechanism, which raise DomainError with the owner's name where a result is not finite.

    Where the state itself is not, that is reported; the kernels have no part in it.
    """

    def __init__(self, kernels: Kernels) -> None:
        self._kernels = kernels

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        value = getattr(self._kernels, name)
        if not callable(value):
            self.__dict__[name] = value
        return value


def _method(name: str, kernel: str, arguments: tuple[str, ...]) -> Callable[..., Any]:
    def checked(self: FiniteKernels, *positional: Any, **named: Any) -> Any:
        value = getattr(self._kernels, name)(*positional, **named)
        if not is_finite(value):
            raise refusal(self._kernels, kernel, **dict(zip(arguments, positional, strict=False)), **named)
        return value

    return checked


for _name, _of in CHECKED_KERNELS.items():
    setattr(FiniteKernels, _name, _method(_name, *_of))


def watched(kernels: Kernels) -> Kernels:
    """The same kernels, watched. What they have, a `FiniteKernels` has, so it passes for kernels wherever these are called and read."""
    return kernels if isinstance(kernels, FiniteKernels) else cast(Kernels, FiniteKernels(kernels))


def check_instant(kernels: Kernels, q: np.ndarray, qd: np.ndarray | None = None, t: float = 0.0, p: np.ndarray | None = None) -> None:
    """Raise DomainError with the owner of the first term that is not a number at an instant; without q̇ of positions alone."""
    for kernel in KERNELS_IN_ORDER:
        if CHECKED_KERNELS[kernel][1] is VELOCITY and qd is None:
            continue
        if not is_finite(kernels.values(kernel, t, q, qd, p)):  # plain numbers: a sparse matrix takes longer to make than to check
            raise refusal(kernels, kernel, q=q, qd=qd, t=t, p=p)


def on_the_way(kernels: Kernels, q: np.ndarray, qd: np.ndarray, t: float, tried: float, p: np.ndarray | None = None) -> DomainError | None:
    """Why a run that came to a state and tried to go on to another time cannot, if a term is not a number there."""
    try:
        ahead = [fraction * (tried - t) for fraction in STEP_FRACTIONS] + [TIME_FRACTION * max(abs(t), abs(tried - t))]
        for h in ahead:  # in time alone: where a rate has become infinite, it leads nowhere
            check_instant(kernels, q, qd, t + h, p)
        qdd = _accelerations(kernels, q, qd, t, p)
        for h in ahead:
            with np.errstate(over="ignore", invalid="ignore"):
                later = q + h * (qd + h / 2 * qdd), qd + h * qdd
            check_instant(kernels, *later, t + h, p)
    except DomainError as found:
        return found
    except ModelError:  # of a callback that takes no such state
        return None
    return None


def _accelerations(kernels: Kernels, q: np.ndarray, qd: np.ndarray, t: float, p: np.ndarray | None) -> np.ndarray:
    from ncgen.solver.formalisms import accelerations_by

    formalism = accelerations_by("lagrange")
    try:
        return formalism.motion(kernels, q, qd, t, p, {}).qdd
    except NcgenError:
        return np.zeros(kernels.n)  # they are not determined: straight on


def refusal(
    kernels: Kernels,
    kernel: str,
    q: np.ndarray,
    t: float = 0.0,
    p: np.ndarray | None = None,
    qd: np.ndarray | None = None,
    **more: np.ndarray,
) -> DomainError:
    """The sentence for a kernel that is not finite with these arguments: whose it is, when and where."""
    p = kernels.p0 if p is None else p
    state = {"q": q, "qd": q if qd is None else qd, "t": t, "p": p, **more}
    cause = _of_arguments(kernels, state) or _of_terms(kernels, _first(kernels, kernel, state), state)
    return DomainError(f"{kernels.name}: {cause}")


def _first(kernels: Kernels, kernel: str, state: dict[str, Any]) -> str:
    """The kernel where it begins: a derivative is NaN where the term itself is."""
    for name in KERNELS_IN_ORDER:
        arguments = [state[x] for x in CHECKED_KERNELS[name][1]]
        if name == kernel or not is_finite(getattr(kernels, name)(*arguments)):
            return name
    return kernel


def _of_arguments(kernels: Kernels, state: dict[str, Any]) -> str | None:
    """What is wrong with the arguments themselves."""
    if not math.isfinite(state["t"]):
        return f"the time is {state['t']}; it must be a finite number of seconds"
    names = {"p": kernels.parameters, "q": kernels.coordinates, "qd": tuple(f"rate({name})" for name in kernels.coordinates)}
    for array, noun in (("p", "parameter "), ("q", "coordinate "), ("qd", "")):
        values = np.asarray(state[array], dtype=float)
        if not is_finite(values):
            first = int(np.argmin(np.isfinite(values)))
            remedy = "give it a number" if array == "p" else "give the start in numbers, or take smaller steps (rtol, max_step)"
            return f"{noun}{names[array][first]} is {values[first]} at t = {state['t']:.6g} s, which is not a number; {remedy}"
    return None


def _of_terms(kernels: Kernels, kernel: str, state: dict[str, Any]) -> str:
    from ncgen.program.differentiation.tangent_programs import TANGENTS
    from ncgen.program.kernel_table import KERNELS

    definition = {**KERNELS, **TANGENTS}[kernel]
    equations = kernels.programs.equations
    for arguments in _close(state):
        for term in definition.terms(equations):
            if not _is_term_finite(term, definition, equations, arguments):
                where = _where(kernels, term, state)
                return f"{DERIVED.get(kernel, '')}{_words(kernels, term)} is not a number at t = {state['t']:.6g} s{where}; {REMEDY}"
    return f"{kernel} is not a number at t = {state['t']:.6g} s, although every part of it is: the numbers are too large; {REMEDY}"


def _close(state: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The arguments, and some a few roundings away: at the very edge of a term two programs for it may differ."""
    yield state
    for name in ("t", "q", "qd"):
        for roundings in (-16, 16):
            yield state | {name: state[name] * (1 + roundings * float(np.finfo(float).eps))}


def _is_term_finite(term: Term, definition: Kernel, equations: Terms, state: dict[str, Any]) -> bool:
    """True if one term alone gives numbers to a kernel."""
    from ncgen.program.assemble import programs_of
    from ncgen.program.ir.evaluate import evaluate
    from ncgen.symbolic.equations import Equations

    def only(terms: tuple[Term, ...]) -> tuple[Term, ...]:
        return tuple(x for x in terms if x is term)

    alone = Equations(model=equations.model, rows=only(equations.rows), masses=only(equations.masses), forces=only(equations.forces))
    program = programs_of([definition], alone, math.inf)[definition.name][0]
    inputs: dict[str, Any] = {name: float(x) if name == "t" else np.asarray(x, dtype=float).tolist() for name, x in state.items()}
    try:
        values = [] if program is None else evaluate(program, inputs)
    except (ArithmeticError, ValueError):
        return False  # what Python has in place of infinity and of no number at all
    return all(not isinstance(x, complex) and math.isfinite(x) for x in values)


def _words(kernels: Kernels, term: Term) -> str:
    """A term by the user's own name for it."""
    if term.row is not None:
        return f"constraint {term.row + 1} ({kernels.rows[term.row].label}, {term.owner})"
    if term in kernels.programs.equations.masses:
        return f"the mass of {term.label} ({term.owner})"
    return term.label


def _where(kernels: Kernels, term: Term, state: dict[str, Any]) -> str:
    """The coordinates and parameters that a term is made of, as far as they are few."""
    used = dict.fromkeys(c.name for form in term.scalars for _, c in form)
    values = [f"{name} = {state['q'][kernels.index[name]]:.6g}" for name in used if name in kernels.index]
    named = {s.name for v in term.data for s in ([v.symbol] if isinstance(v, Symbolic) else getattr(v, "free_symbols", ()))}
    values += [f"{name} = {value:.6g}" for name, value in zip(kernels.parameters, state["p"], strict=True) if name in named]
    return f" ({', '.join(values)})" if 0 < len(values) <= MAX_NAMED_NUMBERS else ""
