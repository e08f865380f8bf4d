"""Objectives: functions of a motion whose derivatives the caller knows, looked at before and after they are called."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ncgen.errors import ModelError
from ncgen.solver.argument_checks import array_of, echo, numbers_of


def check_objective(objective: object) -> None:
    """Raise ModelError for what is no function."""
    if not callable(objective):
        raise ModelError(f"objective: {echo(objective)} given; give a function (q, qd) -> (value, its derivatives by both)")


def of_objective(objective: Callable[..., Any], q: np.ndarray, qd: np.ndarray, *more: str) -> tuple[Any, ...]:
    """(value, derivatives by q, by qd, …) of an objective at a motion q, qd (K, n); more: what it returns behind these.

    Raises ModelError for something else, and for derivatives of another shape or that are not finite.
    """
    returned = objective(q, qd)
    wanted = ", ".join(("value", "derivatives by q", "by qd", *more))
    if not (isinstance(returned, (tuple, list)) and len(returned) == 3 + len(more)):
        raise ModelError(f"objective: it returned {echo(returned)}; it must return ({wanted})")
    value = numbers_of(returned[0], "objective: its value")
    if value.size != 1:
        raise ModelError(f"objective: its value has the shape {value.shape}; it must be one number")
    by_q, by_qd = (filled(array, q, f"derivative by {name}") for name, array in zip(("q", "qd"), returned[1:3], strict=True))
    return (float(value.item()), by_q, by_qd, *returned[3:])


def filled(array: np.ndarray | None, like: np.ndarray, label: str) -> np.ndarray:
    """Derivatives of an objective, where None stands for 0. Raises ModelError for another shape, and for what is not finite."""
    return np.zeros_like(like) if array is None else array_of(array, like.shape, f"objective: {label}")
