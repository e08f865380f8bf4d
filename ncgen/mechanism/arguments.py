"""Arrays on their way to kernels: plain numbers, or one sentence that says what was given in their place.

C believes what it is told about arrays, so whatever it reads and writes has gone through here or was made by ncgen itself.
"""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Complex, Real

import numpy as np
from numpy.typing import ArrayLike

from ncgen.errors import NcgenError

ECHOED = 60
"""Characters of what was given that a message repeats."""


def numbers(given: ArrayLike | None, what: str, complex_too: bool = False) -> np.ndarray:
    """Real numbers as doubles, contiguous, of the shape they were given in; doubles that are so already as they are.

    what: the argument's name in messages; complex_too: complex and longer numbers stay what they are
    Raises NcgenError for complex and masked numbers, rows of different lengths, None, texts and other things that are no numbers.
    """
    if type(given) is np.ndarray and given.dtype == float and given.flags.carray:
        return given
    if isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given):
        raise NcgenError(f"{what} has masked numbers; fill them")
    try:
        array = np.asarray(given)
    except ValueError:
        raise NcgenError(f"{what} has rows of different lengths; give an array") from None
    if array.dtype.kind == "c" and not complex_too:
        raise NcgenError(f"{what} is complex; real numbers are needed here, kernels of backend='numpy' take complex ones")
    kind = Complex if complex_too else Real
    if array.dtype.kind not in "biufcO" or (array.dtype.kind == "O" and not all(isinstance(x, kind) for x in array.flat)):
        said = repr(given).replace("\n", " ")
        raise NcgenError(f"{what} has something that is no number: {said if len(said) <= ECHOED else said[:ECHOED] + '…'}")
    if array.dtype.kind == "O":
        try:
            array = array.astype(complex if any(np.iscomplexobj(x) for x in array.flat) else float)
        except OverflowError:
            raise NcgenError(f"{what} has a number beyond 1.8e308; give one that a double can hold") from None
    dtype = np.result_type(float, array.dtype) if complex_too else np.dtype(float)
    return np.require(array, dtype, ["C", "A"]).reshape(array.shape)


def sized(values: ArrayLike | None, count: int, what: str, complex_too: bool = False) -> np.ndarray:
    """Real numbers (…, count) as `numbers` gives them.

    Raises NcgenError for another last axis, with both shapes, and what `numbers` raises.
    """
    array = numbers(values, what, complex_too)
    if array.shape[-1:] != (count,):
        raise NcgenError(f"{what} has the shape {array.shape}; give (…, {count})")
    return array


def place(array: object, shape: tuple[int, ...], what: str, beside: Iterable[np.ndarray] = ()) -> np.ndarray:
    """The array itself, where C may write. Raises NcgenError for another one, or one that shares memory with those it is written beside."""
    if not (isinstance(array, np.ndarray) and array.dtype == float and array.flags.carray and array.shape == shape):
        raise NcgenError(f"{what} must be a contiguous array of {shape} doubles that may be written to")
    if any(np.may_share_memory(array, other) for other in beside):
        raise NcgenError(f"{what} shares memory with an argument; give an array of its own")
    return array


def constant(array: np.ndarray) -> np.ndarray:
    """An array that nobody writes to any more."""
    array.flags.writeable = False
    return array
