"""What hands arrays to compiled code: numbers of the right type, count and layout, or one sentence."""

from __future__ import annotations

import numpy as np
import pytest

import ncgen
from ncgen.errors import NcgenError
from ncgen.mechanism.arguments import laid, pointer
from ncgen.mechanism.run_arguments import InitialState
from ncgen.toolchain.abi import DUAL, abi, runtime_abi


@pytest.mark.parametrize(
    "array, count, said",
    [
        (np.zeros(3), 4, "^q: 3 numbers on their way to C, which takes 4$"),
        (np.zeros(5), 4, "^q: 5 numbers on their way to C, which takes 4$"),
        (np.zeros(4, np.float32), 4, "^q: ndarray float32, strides .* a contiguous array of float64 is needed$"),
        (np.zeros(4, ">f8"), 4, "^q: ndarray >f8"),
        (np.zeros(4, complex), 4, "^q: ndarray complex128"),
        (np.zeros(4, int), 4, "^q: ndarray int64"),
        (np.zeros(8)[::2], 4, r"^q: ndarray float64, strides \(16,\)"),
        (np.zeros((2, 2)).T.copy(order="F")[::-1], 4, "^q: ndarray float64"),
        (np.frombuffer(bytearray(33), dtype=np.uint8)[1:].view(float), 4, "^q: ndarray float64"),
        (np.ma.masked_array(np.zeros(4)), 4, "^q: MaskedArray float64"),
        ([0.0] * 4, 4, "^q: list  on its way to C"),
    ],
)
def test_other_arrays_are_refused(array, count, said):
    """Each of these would be read as something else, or beyond its end."""
    with pytest.raises(NcgenError, match=said):
        pointer(abi(), array, "double[]", count, "q")


def test_an_array_arrives_where_it_lies():
    """C writes into the array itself; None is NULL; each number type has its own arrays."""
    array, ffi = np.arange(4.0), abi()
    pointer(ffi, array, count=4)[2] = 7.0
    assert array.tolist() == [0.0, 1.0, 7.0, 3.0] and pointer(ffi, None) == ffi.NULL
    for number, dtype in (("float", np.float32), ("double", float), ("long double", np.longdouble), (DUAL.name, complex)):
        pointer(runtime_abi(number), np.zeros(2, dtype), "ncgen_real[]", 2)
        with pytest.raises(NcgenError, match="on its way to C"):
            pointer(runtime_abi(number), np.zeros(2, np.float16), "ncgen_real[]", 2)
    pointer(ffi, np.zeros(2, np.intc), "int[]", 2)
    with pytest.raises(NcgenError, match="on its way to C"):
        pointer(ffi, np.zeros(2, np.int64), "int[]", 2)


def test_what_is_laid_out_keeps_its_numbers():
    """Big-endian, strided and read-only arrays, lists and integers become what C reads."""
    read_only = np.arange(3.0)
    read_only.flags.writeable = False
    for given in ([0, 1, 2], np.arange(3, dtype=">f8"), np.arange(0.0, 6.0)[::2] / 2, read_only, np.arange(3, dtype=np.uint8)):
        found = laid(given, np.float32, 3, "q")
        assert found.dtype == np.float32 and found.flags.c_contiguous and found.tolist() == [0.0, 1.0, 2.0]
    with pytest.raises(NcgenError, match=r"^q has the shape \(2,\); give \(…, 3\)$"):
        laid([0.0, 1.0], float, 3, "q")


@pytest.mark.parametrize("wrong", ["q", "velocities", "p", "sizes", "movable"])
def test_a_run_in_c_reads_what_there_is(wrong):
    """The last line before C: an array of another size that came past all checks is refused there."""
    from ncgen.solver.engines.acceleration_forms import all_coordinates

    kernels = ncgen.compile(ncgen.load("pendulum"))
    given = {"q": kernels.q0, "velocities": np.zeros(kernels.n), "p": kernels.p0, "sizes": np.ones(2 * kernels.n + 1)}
    given["movable"] = np.zeros(2, np.intc)
    given[wrong] = np.append(given[wrong], 0)
    initial = InitialState(*(given.pop(name) for name in ("q", "velocities", "p")))
    with pytest.raises(NcgenError, match=f"{wrong}.*"):
        all_coordinates(kernels).simulate("dopri5", [0.0, 0.1], initial, formalism=1, **given)
