"""Arrays on their way to kernels: plain numbers, or one sentence that says what was given in their place.

C believes what it is given about arrays, so whatever it reads and writes goes through `pointer`, and what a caller gave through `numbers`
before that; tests/test_structure.py has the few other places, with their reasons.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from numbers import Complex, Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from ncgen.errors import NcgenError, counted

if TYPE_CHECKING:
    from ncgen.toolchain.abi import InC, Interface

DTYPES = {f"{name}[]": np.dtype(code) for name, code in {"int": "i", "long": "l", "float": "f", "double": "d", "long double": "g"}.items()}
"""{array of C: NumPy's type of its numbers}; other ones are dual numbers, NumPy's complex ones."""

ECHOED = 60
"""Characters of what was given that a message repeats."""


def numbers(values: ArrayLike | None, label: str, complex_too: bool = False) -> np.ndarray:
    """Real numbers as doubles, contiguous, of the shape they were given in; doubles that are so already as they are.

    label: the argument's name in messages; complex_too: complex and longer numbers stay what they are
    Raises NcgenError for complex and masked numbers, rows of different lengths, None, texts and other things that are no numbers.
    """
    if type(values) is np.ndarray and values.dtype == float and values.flags.carray:
        return values
    if has_masked(values):
        raise NcgenError(f"{label} has masked numbers; fill them")
    try:
        array = np.asarray(values)
    except ValueError:
        raise NcgenError(f"{label} has rows of different lengths; give an array") from None
    if array.dtype.kind == "c" and not complex_too:
        raise NcgenError(f"{label} is complex; real numbers are needed here, kernels of backend='numpy' take complex ones")
    kind = Complex if complex_too else Real
    if array.dtype.kind not in "biufcO" or (array.dtype.kind == "O" and not all(isinstance(x, kind) for x in array.flat)):
        echoed = repr(values).replace("\n", " ")
        raise NcgenError(f"{label} has a value that is not a number: {echoed if len(echoed) <= ECHOED else echoed[:ECHOED] + '…'}")
    if array.dtype.kind == "O":
        try:
            array = array.astype(complex if any(np.iscomplexobj(x) for x in array.flat) else float)
        except OverflowError:
            raise NcgenError(f"{label} has a number beyond 1.8e308; give one that a double can hold") from None
    dtype = np.result_type(float, array.dtype) if complex_too else np.dtype(float)
    return np.require(array, dtype, ["C", "A"]).reshape(array.shape)


def has_masked(values: object) -> bool:
    """True for an array with masked numbers; without importing NumPy's module of these where there are none."""
    return isinstance(values, np.ndarray) and type(values) is not np.ndarray and bool(np.ma.is_masked(values))


def sized(values: ArrayLike | None, count: int, label: str, complex_too: bool = False) -> np.ndarray:
    """Real numbers (…, count) as `numbers` gives them.

    Raises NcgenError for another last axis, with both shapes, and what `numbers` raises.
    """
    array = numbers(values, label, complex_too)
    if array.shape[-1:] != (count,):
        raise NcgenError(f"{label} has the shape {array.shape}; give (…, {count})")
    return array


def writable(array: object, shape: tuple[int, ...], label: str, other_arrays: Iterable[np.ndarray] = ()) -> np.ndarray:
    """The array itself, where C may write. Raises NcgenError for another one, or one that shares memory with `other_arrays`."""
    if not (isinstance(array, np.ndarray) and array.dtype == float and array.flags.carray and array.shape == shape):
        raise NcgenError(f"{label} must be a contiguous array of {shape} doubles that may be written to")
    if any(np.may_share_memory(array, other) for other in other_arrays):
        raise NcgenError(f"{label} shares memory with an argument; give an array of its own")
    return array


def laid(values: ArrayLike, dtype: DTypeLike, count: int, label: str) -> np.ndarray:
    """Real numbers (…, count) as C reads them: contiguous, of its type. Raises NcgenError as `sized` does."""
    if type(values) is np.ndarray and values.dtype == dtype and _is_laid(values.flags) and values.shape[-1:] == (count,):
        return values
    return np.ascontiguousarray(sized(values, count, label), dtype=dtype)


def pointer(ffi: Interface, array: np.ndarray | None, kind: str = "double[]", count: int | None = None, label: str = "an array") -> InC:
    """An array as an argument in C, which keeps it alive; NULL for None.

    kind: of an array in C; count: numbers that C reads or writes, None where ncgen has just made the array for this call
    Raises NcgenError for an array of other numbers or of another count, one that is not contiguous, and a masked one.
    """
    if array is None:
        return ffi.NULL
    dtype = DTYPES[kind] if kind in DTYPES else _dtype(ffi, kind)
    if type(array) is not np.ndarray or array.dtype != dtype or not (array.flags.carray or _is_laid(array.flags)):
        description = f"{array.dtype}, strides {array.strides}" if isinstance(array, np.ndarray) else ""
        raise NcgenError(f"{label}: {type(array).__name__} {description} on its way to C; a contiguous array of {dtype} is needed")
    if count is not None and array.size != count:
        raise NcgenError(f"{label}: {counted(array.size, 'number')} on their way to C, which takes {count}")
    return ffi.from_buffer(kind, array)


@cache
def _dtype(ffi: Interface, kind: str) -> np.dtype:
    return DTYPES.get(f"{ffi.typeof(kind).item.cname}[]", np.dtype(complex))


def _is_laid(flags: Any) -> bool:
    return flags.c_contiguous and flags.aligned


def constant(array: np.ndarray) -> np.ndarray:
    """An array that nobody writes to any more."""
    array.flags.writeable = False
    return array
