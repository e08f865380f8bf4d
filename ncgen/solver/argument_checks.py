"""Checks of arguments: positions, parameters and names as arrays and tuples, or one sentence that says what is wrong.

All public functions of the solver take them in the same ways, because all use these checks.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from numbers import Real
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import ModelError, NcgenError, counted, shown, written
from ncgen.mechanism.arguments import has_masked, numbers
from ncgen.methods.table import is_real
from ncgen.model import Model
from ncgen.solver.name_lists import listed_names, offer
from ncgen.solver.parameter_checks import check_parameters

ArrayOrNamed: TypeAlias = "ArrayLike | Mapping[str, ArrayLike]"
"""In signatures: numbers in their order, or some of them by name; of a batch rows of numbers, or by name a number or one a state."""


class Outline(Protocol):
    """Names, sizes and defaults of a mechanism: all that checking needs of its kernels."""

    @property
    def name(self) -> str: ...

    @property
    def model(self) -> Model: ...

    @property
    def coordinates(self) -> tuple[str, ...]: ...

    @property
    def parameters(self) -> tuple[str, ...]: ...

    @property
    def index(self) -> Mapping[str, int]: ...

    @property
    def n(self) -> int: ...

    @property
    def q0(self) -> np.ndarray: ...

    @property
    def p0(self) -> np.ndarray: ...

    def start(self, p: ArrayLike | None = None) -> np.ndarray:
        """The initial position (n,) in m and rad at parameters p (n_p,)."""
        ...


Mechanism = TypeVar("Mechanism", bound=Outline)
Value = TypeVar("Value")

ORTHOGONAL = 1e-6
"""How far an entry of Rᵀ R of a rotation may be off the unit matrix: rotations written with seven digits pass, sheared ones do not."""

ECHOED = 40
"""Characters of what was given that a message repeats."""


def checked_kernels(kernels: Mechanism) -> Mechanism:
    """The kernels themselves. Raises ModelError for anything else, such as a model that was not compiled."""
    try:
        _ = kernels.q0, kernels.p0, kernels.index, kernels.parameters
    except AttributeError:
        raise ModelError(f"kernels needed, {echo(kernels)} given; ncgen.compile(model) makes them") from None
    return kernels


def parameters(kernels: Outline, p: ArrayOrNamed | None = None) -> np.ndarray:
    """Parameters as an array of one's own, shape (n_p,).

    p: None for the defaults, numbers in the order of `kernels.parameters`, or {name: number}; those not named keep their defaults
    Raises ModelError where numbers are missing, too many or not finite, for an unknown name, and for what the model refuses as a number
    in the place of the parameter, such as a negative mass.
    """
    kernels = checked_kernels(kernels)
    array = _numbers(kernels.parameters, kernels.p0, p, "p", "parameter")
    if p is not None:
        check_parameters(kernels, array)
    return array


def position(kernels: Outline, q: ArrayOrNamed | None = None, p: ArrayLike | None = None, label: str = "q") -> np.ndarray:
    """A position, closed or not, as an array of one's own, shape (n,) in m and rad.

    q: None for the initial one at the parameters p (n_p,), numbers in the order of `kernels.coordinates`, or {name: number};
        coordinates not named stay where they are initially
    label: the argument's name in messages
    Raises ModelError as `parameters` does.
    """
    kernels = checked_kernels(kernels)
    return _numbers(kernels.coordinates, kernels.start(p), q, label, "free coordinate")


def closing(tolerance: object) -> float:
    """The relative residual up to which a position passes as closed. Raises ModelError unless it is between 0 and 1."""
    if not (is_real(tolerance) and 0 < tolerance < 1):
        raise ModelError(f"closing tolerance: {echo(tolerance)} given; it must be a number between 0 and 1, such as 1e-6")
    return float(tolerance)


def values_by_name(argument: Mapping[str, Value] | None, label: str) -> dict[str, Value]:
    """{name: value} whose names are texts, {} from None. Raises ModelError for anything else."""
    if argument is not None and not isinstance(argument, Mapping):
        raise ModelError(f"{label}: {echo(argument)} given; give {{name: value}}")
    names_of(None if argument is None else tuple(argument), label)
    return dict(argument or {})


def names_of(
    argument: str | Iterable[str] | None, label: str, known: Collection[str] | None = None, kind: str = "free coordinate"
) -> tuple[str, ...]:
    """Names from one name or several; () from None.

    known: the names there are, if they are to be compared with; kind: what they are names of, for messages
    Raises ModelError for what is no text, for a name that comes twice, and for an unknown one.
    """
    if argument is None:
        return ()
    is_single = isinstance(argument, str) or not isinstance(argument, Iterable) or (isinstance(argument, np.ndarray) and argument.ndim == 0)
    names = (argument,) if is_single else tuple(argument)
    if odd := [name for name in names if not isinstance(name, str)]:
        raise ModelError(f"{label}: {echo(odd[0])} is no name; give one name or a list of names")
    names = tuple(map(str, names))  # a text of NumPy's is one like others
    if twice := [name for k, name in enumerate(names) if name in names[:k]]:
        raise ModelError(f"{label}: {twice[0]} is named twice; name it once")
    if known is not None:
        for name in names:
            known_name(name, known, label, kind)
    return names


def known_name(name: str, known: Collection[str], label: str, kind: str = "free coordinate") -> str:
    """A name that is known. Raises ModelError for another one, with those there are or the nearest of them."""
    if not isinstance(name, str) or name not in known:
        raise ModelError(f"{label}: the mechanism has no {kind} {echo(name)}; {offer(name, tuple(known))}")
    return name


def finite(value: object, label: str) -> float:
    """A number as a float. Raises ModelError unless it is a real, finite one."""
    plain = value.item() if isinstance(value, (np.ndarray, np.generic)) and value.ndim == 0 else value
    try:
        number = float(plain) if isinstance(plain, Real) else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ModelError(f"{label} is {shown(plain) if isinstance(plain, str) else echo(plain)}; it must be a finite number")
    return number


def positive(value: object, label: str) -> float:
    """A number as a float. Raises ModelError unless it is finite and above zero."""
    number = finite(value, label)
    if not number > 0:
        raise ModelError(f"{label} is {echo(value)}; it must be positive")
    return number


def count(value: object, label: str) -> int:
    """A positive whole number. Raises ModelError for another one."""
    number = finite(value, label)
    if not (number >= 1 and number == int(number)):
        raise ModelError(f"{label} is {echo(value)}; it must be a positive whole number")
    return int(number)


def several(values: Any, label: str) -> np.ndarray:
    """Finite numbers as an array (K,). Raises ModelError for anything else, naming the place from 0."""
    array = real_numbers(list(values) if isinstance(values, Iterator) else values, label)
    if array is None or array.ndim != 1:
        raise ModelError(f"{label}: {echo(values)} given; a list of numbers is needed")
    for k in np.flatnonzero(~np.isfinite(array))[:1]:
        finite(array[k], f"{label}[{k}]")
    return array


def numbers_of(values: ArrayLike, label: str) -> np.ndarray:
    """Finite real numbers as contiguous doubles, of the shape they were given in.

    Raises ModelError for complex, masked and non-finite numbers, texts, objects and rows of different lengths, naming the place from 0.
    """
    try:
        array = numbers(values, label)
    except NcgenError as error:
        raise ModelError(str(error)) from None
    if not np.isfinite(array).all():
        index = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise ModelError(f"{label}{list(index) if index else ''} is {array[index]}; it must be a finite number")
    return array


def array_of(values: ArrayLike, shape: tuple[int, ...], label: str) -> np.ndarray:
    """Finite real numbers of one shape. Raises ModelError for another shape, with both, and what `numbers_of` raises."""
    array = numbers_of(values, label)
    if array.shape != shape:
        raise ModelError(f"{label} has the shape {array.shape}; give {shape}")
    return array


def rotation_of(values: ArrayLike, label: str) -> np.ndarray:
    """A rotation matrix R (3, 3). Raises ModelError where an entry of Rᵀ R is off the unit matrix by more than 1e-6, or det R < 0."""
    array = array_of(values, (3, 3), label)
    with np.errstate(over="ignore", invalid="ignore"):
        off = float(np.max(np.abs(array.T @ array - np.eye(3))))
    if not off <= ORTHOGONAL:
        raise ModelError(f"{label}: Rᵀ R is off the unit matrix by {off:.3g}, {ORTHOGONAL:g} is allowed; give an orthogonal matrix")
    if np.linalg.det(array) < 0:
        raise ModelError(f"{label}: its determinant is -1, a reflection; give a rotation, of determinant 1")
    return array


def numbers_by_name(argument: Mapping[str, Any], known: Collection[str], label: str, kind: str = "free coordinate") -> dict[str, float]:
    """{name: number} with names that are known. Raises ModelError for another name, and for what is no finite number."""
    if not isinstance(argument, Mapping):
        raise ModelError(f"{label}: {echo(argument)} given; give {{name: number}}")
    return {known_name(name, known, label, kind): finite(value, f"{label}: {name}") for name, value in argument.items()}


def _numbers(names: tuple[str, ...], defaults: np.ndarray, argument: ArrayOrNamed | None, label: str, kind: str) -> np.ndarray:
    """One number a name: the defaults, those given by name in their place, or all in the order of the names."""
    if argument is None:
        return np.array(defaults, dtype=float)
    if isinstance(argument, Mapping):
        wanted = numbers_by_name(argument, names, label, kind)
        return np.array([wanted.get(name, default) for name, default in zip(names, defaults, strict=True)], dtype=float)
    array = real_numbers(argument, label)
    if array is None or array.shape != (len(names),):
        given_text = (
            echo(argument) if array is None else counted(len(array), "number") if array.ndim == 1 else f"an array of shape {array.shape}"
        )
        needed = f"{len(names)} needed: {listed_names(names)}" if names else f"the mechanism has no {kind}"
        raise ModelError(f"{label}: {given_text} given, {needed}")
    for k in np.flatnonzero(~np.isfinite(array))[:1]:
        finite(array[k], f"{label}: {names[k]}")
    return array


def real_numbers(argument: Any, label: str) -> np.ndarray | None:
    """Real numbers as an array of one's own; None for anything else, texts that look like numbers included. Raises ModelError for masked
    ones, which look like others."""
    if has_masked(argument):
        raise ModelError(f"{label} has masked numbers; fill them")
    try:
        return np.array(numbers(argument, label))
    except NcgenError:
        return None


def has_events(model: Model) -> bool:
    """True for a model in which something happens on the way of a motion."""
    return bool(model.events or model.frictions or model.ratchets or model.locks)


def names_of_events(model: Model) -> list[str]:
    """Of events, and of elements that events begin and end."""
    return [*model.events, *model.frictions, *model.ratchets, *model.locks]


def refuse_events(model: Model, function: str) -> None:
    """Raise ModelError for a model with events, which `function`, a public function, does not have yet."""
    if has_events(model):
        names = listed_names(names_of_events(model))
        raise ModelError(f"{model.name}: {function} does not support events yet ({names}); take ncgen.simulate, or leave them out")


def refuse_sticking(model: Model, function: str) -> None:
    """Raise ModelError for a model with dry friction, locks or ratchets, which `function`, a public function, would leave out."""
    if names := [*model.frictions, *model.contacts, *model.ratchets, *model.locks]:
        words = listed_names(names)
        raise ModelError(f"{model.name}: {function} has no dry friction, locks or ratchets ({words}); take a model without them")


def echo(value: object) -> str:
    """What was given, shortened."""
    text = value if isinstance(value, str) and value.isprintable() and value else written(value)
    return text if len(text) <= ECHOED else text[: ECHOED - 1] + "…"


def refuse_callbacks(kernels: Outline) -> None:
    """Raise ModelError where a force is a Python function, which has no derivative."""
    if kernels.model.callbacks:
        raise ModelError(f"{kernels.name}: a force of a Python function has no derivative; write it as an expression")
