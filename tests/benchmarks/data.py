"""A model with its data as parameters, and what they cost: operations of the state derivative.

Numbers of a model's facts become parameters: those of inertia, or all. Zeros stay what they are, and so do directions along an axis.
Numbers that are equal are one datum, as in a drawing; where a mechanism moves at special lengths alone, its size is its one length.

What a model's own numbers save by chance, such as a product of inertia that is 0, parameters do not. So it is compared with itself with
other numbers, too.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ncgen.compiler import compile
from ncgen.errors import ModelError
from ncgen.exchange.toml_reader import model_of
from ncgen.exchange.toml_writer import to_toml
from ncgen.model import Model
from ncgen.model.facts import Fact
from ncgen.model.values import Value, as_sympy, is_number
from ncgen.program.ir.cost import cost
from ncgen.program.motions.dynamics import assemble_motion
from ncgen.solver.engines.acceleration_forms import own_positions

LENGTHS: Mapping[str, tuple[str, ...]] = {
    "point": ("position",),
    "attach_point": ("position",),
    "distance": ("length",),
    "vector_segment": ("length",),
    "angle": ("lengths",),
    "gear": ("radius_first", "radius_second"),
    "rack": ("radius",),
    "rolling": ("radius",),
    "screw": ("pitch",),
}
"""{word of model files: its arguments}."""

FORCES: Mapping[str, tuple[str, ...]] = {
    "spring": ("stiffness", "damping", "free_length"),
    "torsion_spring": ("stiffness", "damping", "free_angle"),
    "gravity": ("field",),
}

DIRECTIONS = ("vector", "attach_vector")

GENERAL = 3
"""Elements of a basis from which on a body's centre of mass may be anywhere, and its tensor be any."""

MOMENTS = "inertia"
"""How kinds begin that are entries of a tensor."""

ASIDE = 0.01
"""By which share other numbers differ at most."""

Put: TypeAlias = Callable[[str, float], Value]
"""(kind of a number, the number) -> what stands for it."""


def with_inertia_as_parameters(model: Model) -> Model:
    """A copy whose masses, centres and moments of inertia are parameters, at the numbers that they were."""
    copy = _copied(model)
    put = _Equal(copy).put
    return _told(copy, [_with_inertia(copy, fact, put) for fact in copy.facts])


def with_data_as_parameters(model: Model, size_alone: bool = False) -> Model:
    """A copy whose numbers of inertia, lengths, directions, springs and gravity are parameters.

    size_alone: of lengths and directions that of the whole is the only one
    Raises ModelError where they cannot be parameters.
    """
    copy = _copied(model)
    return _with_each(copy, _Equal(copy).put, size_alone)


def with_data(model: Model, put: Put, size_alone: bool = False) -> Model:
    """A copy with other numbers for the same data, which are asked for in the order of the parameters. Raises ModelError where there is no
    such mechanism."""
    return _with_each(_copied(model), put, size_alone)


def _with_each(copy: Model, put: Put, size_alone: bool) -> Model:
    chosen = partial(_sized, put) if size_alone else put
    return _told(copy, [_with_data(copy, fact, chosen, directions=not size_alone) for fact in copy.facts])


def with_other_numbers(model: Model, inertia_alone: bool = False) -> Model:
    """A copy whose numbers differ by a hundredth, those that were equal alike. Raises ModelError where there is no such mechanism."""
    copy = _copied(model)
    copy.facts = [_with_other_moments(copy, fact) for fact in copy.facts]
    changed = partial(_with_inertia, copy, put=_aside) if inertia_alone else partial(_with_data, copy, put=_aside, directions=True)
    return _told(copy, [changed(fact) for fact in copy.facts])


def _copied(model: Model) -> Model:
    return pickle.loads(pickle.dumps(model))


def _told(copy: Model, facts: Sequence[Fact]) -> Model:
    """The model of these facts; parameters that the copy was told meanwhile come first."""
    copy.facts = [*(fact for fact in copy.facts if fact.word == "parameter"), *(fact for fact in facts if fact.word != "parameter")]
    return model_of(to_toml(copy), Path(f"{copy.name}.toml"))


# -- numbers, and what stands for them ---------------------------------------------------------------------------------


class _Equal:
    """A parameter for all numbers of a kind that are equal but for signs."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.known: dict[tuple[str, float], Value] = {}

    def put(self, kind: str, number: float) -> Value:
        size = abs(number)
        if (kind, size) not in self.known:
            self.known[kind, size] = as_sympy(self.model.parameter(f"datum_{len(self.known) + 1}", size))
        return self.known[kind, size] if number > 0 else -self.known[kind, size]


def _sized(put: Put, kind: str, number: float) -> Value:
    """The same, but for lengths, which are all as large as the size says."""
    return number * put(kind, 1.0) if kind == "length" else put(kind, number)


def _aside(kind: str, number: float) -> float:
    """A number near it, the same for equal numbers of a kind; moments of inertia, which depend on each other, stay."""
    seed = [*kind.encode(), *np.float64(abs(number)).tobytes()]
    return number if kind.startswith(MOMENTS) else number * (1.0 + ASIDE * np.random.default_rng(seed).uniform(-1, 1))


# -- facts -------------------------------------------------------------------------------------------------------------


def _with_data(model: Model, fact: Fact, put: Put, directions: bool) -> Fact:
    """A fact with something else for its numbers."""
    told: dict[str, Any] = fact.arguments
    changed: dict[str, Any] = dict(_with_inertia(model, fact, put).arguments)
    for kind, words in (("length", LENGTHS), ("force", FORCES)):
        changed |= {key: _each(changed[key], partial(put, kind)) for key in words.get(fact.word, ()) if changed.get(key) is not None}
    if fact.word == "angle" and changed.get("lengths") is not None:  # those of unit vectors are no data
        changed["lengths"] = [1.0 if was == 1.0 else new for was, new in zip(told["lengths"], changed["lengths"], strict=True)]
    if fact.word in DIRECTIONS and directions:
        changed["direction"] = _direction(changed["direction"], partial(put, "direction"))
    return replace(fact, arguments=changed)


def _with_inertia(model: Model, fact: Fact, put: Put) -> Fact:
    if fact.word != "body" or fact.arguments.get("mass") is None:
        return fact
    changed: dict[str, Any] = dict(fact.arguments)
    name = changed["name"]
    changed["mass"] = _each(changed["mass"], partial(put, f"mass of {name}"))
    if _has_moments(model, changed):
        changed["inertia"] = _each(changed["inertia"], partial(put, f"{MOMENTS} of {name}"))
        if changed.get("com") is not None:
            changed["com"] = _each(changed["com"], partial(put, "length"))
    return replace(fact, arguments=changed)


def _has_moments(model: Model, told: Mapping[str, Any]) -> bool:
    """Whether a body's moments of inertia are data: those of a bar in space depend on where it points."""
    if told.get("inertia") is None:
        return False
    body = model.bodies[told["name"]]
    return body.frame.planar or len(body.basis) >= GENERAL


def _with_other_moments(model: Model, fact: Fact) -> Fact:
    """The same body with another one in it, whose axes are those of space: no moment exceeds the sum of the others."""
    told: dict[str, Any] = fact.arguments
    if fact.word != "body" or not _has_moments(model, told) or not all(map(is_number, np.ravel(told["inertia"]))):
        return fact
    tensor = np.array(told["inertia"], dtype=float)
    more = ASIDE * np.sum(np.abs(tensor)) * np.array([0.5, 0.45, 0.4])
    tensor = tensor * (1.0 + ASIDE) if tensor.ndim == 0 else tensor + (more if tensor.ndim == 1 else np.diag(more))
    return replace(fact, arguments=told | {"inertia": tensor})


def _each(value: Any, put: Callable[[float], Value]) -> Any:
    """A number or an array of numbers with something else for what is not 0."""
    if is_number(value):
        return put(float(value)) if value else value
    return [_each(x, put) for x in value] if isinstance(value, (list, tuple, np.ndarray)) else value


def _direction(value: Any, put: Callable[[float], Value]) -> Any:
    """A direction in the same way, divided by its length; along an axis it is none."""
    if np.count_nonzero(np.array(value, dtype=object)) < 2 or not all(map(is_number, value)):
        return value
    import sympy

    parts = [as_sympy(x) for x in _each(value, put)]
    squared = sum(x**2 for x in parts)
    size = math.sqrt(squared) if is_number(squared) else sympy.sqrt(squared)
    return [x / size for x in parts]


# -- what they cost ----------------------------------------------------------------------------------------------------

Change: TypeAlias = Callable[[Model], Model]

ALL: tuple[Change, ...] = (with_data_as_parameters, partial(with_data_as_parameters, size_alone=True))
OTHERS: tuple[Change, ...] = (with_other_numbers, partial(with_other_numbers, inertia_alone=True))


def operations(model: Model) -> int | None:
    """Of the state derivative over all coordinates; None where it is not written out, or no position with other parameters is found."""
    kernels = compile(model, "c")
    seen = own_positions(kernels)
    programs = assemble_motion(kernels.programs.equations, *seen, kernels.column_sizes) if seen else None
    return cost(programs.derivative).total if programs else None


def first_written_out(model: Model, changes: Sequence[Change]) -> tuple[Model, int] | None:
    """The model changed in the first way in which its motion is written out, and the operations of its state derivative."""
    for change in changes:
        with suppress(ModelError):
            changed = change(model)
            if (count := operations(changed)) is not None:
                return changed, count
    return None


def data_records(model: Model) -> Iterator[dict]:
    """Records of operations of the state derivative with the model's own numbers, with others, and with parameters for inertial and for all
    data; data: how many parameters; ratio: to the first. Nothing where the motion is not written out.
    """
    own = operations(model)
    if own is None:
        return
    cases = {"other numbers": OTHERS, "inertial data": (with_inertia_as_parameters,), "all data": ALL}
    yield _record(model, "its own numbers", model, own, own)
    for tool, changes in cases.items():
        if found := first_written_out(model, changes):
            yield _record(model, tool, *found, own)


def _record(model: Model, tool: str, changed: Model, count: int, own: int) -> dict:
    data = len(changed.parameters) - len(model.parameters)
    return {"case": "operations", "model": model.name, "tool": tool, "data": data, "operations": count, "ratio": count / own}
