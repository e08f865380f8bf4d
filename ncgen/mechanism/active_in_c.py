"""The rules of what is held after an instant in C (ncgen_active.h)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.listening import called
from ncgen.mechanism.runtime_library import interface_of, runtime_of
from ncgen.mechanism.sliding_in_c import SlidingContact
from ncgen.toolchain.abi import InC

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Kind = Literal[
    "NCGEN_HOLDS_GAP", "NCGEN_HOLDS_RUBBING_GAP", "NCGEN_HOLDS_JOINT", "NCGEN_HOLDS_CONTACT", "NCGEN_HOLDS_RATCHET", "NCGEN_HOLDS_LOCK"
]  # fmt: skip

MASKS = ("before", "happened", "rests", "closed", "still", "wanted", "released")


class Active:
    """What may be held, K things, as of `ncgen_active`; before, happened, rests, closed, still, wanted, released (K,): marks"""

    before: np.ndarray
    happened: np.ndarray
    rests: np.ndarray
    closed: np.ndarray
    still: np.ndarray
    wanted: np.ndarray
    released: np.ndarray

    def __init__(self, kinds: Sequence[Kind], needs: Sequence[int]) -> None:
        self._ffi, self._library = interface_of("double"), runtime_of("double", "events")
        integers = {
            "kinds": np.array([getattr(self._library, kind) for kind in kinds], dtype=np.intc),
            "needs": np.array(needs, dtype=np.intc),
        }
        integers |= {name: np.zeros(len(kinds), dtype=np.intc) for name in MASKS}
        for name in MASKS:
            setattr(self, name, integers[name])
        self._integers, self._loads = integers, np.zeros(4 * len(kinds) + 2)  # and of what slides
        members = {name: pointer(self._ffi, array, "int[]") for name, array in integers.items()}
        self._struct: InC = self._ffi.new("ncgen_active *", members | {"count": len(kinds), "loads": pointer(self._ffi, self._loads)})

    def choose(self, find_loads: Callable[[bool], np.ndarray]) -> bool:
        """Find `wanted`, from what was `released` on the way. Returns False where no set agrees with its loads.

        find_loads: given whether the state is brought onto the constraints of what is wanted, returns the conditions of its loads: values
        and sizes one after the other. Raises what it raises.
        """
        raised = list[BaseException]()

        def call(_: InC, projected: int) -> int:
            pairs = find_loads(bool(projected))
            self._loads[: len(pairs)] = pairs
            return 0

        function = called(self._ffi, "int(*)(void *, int)", call, raised.append)
        self._struct.find_loads = function
        status = self._library.ncgen_find_active(self._struct)
        if raised:
            raise raised[0]
        return bool(status != self._library.NCGEN_NO_MODE)

    def oppose(self, number: int) -> None:
        """Note that a contact that is still would begin to slide against others that were released."""
        self.still[number] = self._library.NCGEN_OPPOSED

    def turn(self, number: int, slip: np.ndarray, slide: SlidingContact, way: np.ndarray, mobility: float, speed: float) -> np.ndarray:
        """The direction (d,) in which a contact slides from now on, and so far slip (d,); others as of `ncgen_write_slip`."""
        made, ways = (self._ffi.new("double[]", numbers.tolist()) for numbers in (slip, way))
        self._library.ncgen_write_slip(slide.in_c, self._struct, number, ways, mobility, speed, 0, made)
        return np.array(self._ffi.unpack(made, len(slip)))

    def change(self, number: int) -> int | None:
        """What has become of something: 0 where it is held from now on, 1 where it no longer is, 2 where it slips to the other side."""
        code = int(self._library.ncgen_change_of(self._struct, number))
        return code - int(self._library.NCGEN_RESTS) if code else None

    def slip(self, number: int, slip: float, side: float) -> int:
        """The direction in which a joint slips, before `slip`; side: of its velocity."""
        return int(self._library.ncgen_slip_of(self._struct, number, int(slip), int(side)))


def direction_of(kind: Kind, held: bool, touches: bool, slip: int, direction: int) -> int:
    """The direction in which the condition of something that may be held is watched.

    touches: of a contact; slip: the direction in which a joint does; direction: that of the condition
    """
    library = runtime_of("double", "events")
    return int(library.ncgen_way_of(getattr(library, kind), held, touches, slip, direction))


@cache
def sides_of(kind: Kind) -> tuple[int, ...]:
    """Of each condition of the load of something that is held: to which side it is released where the condition no longer holds."""
    library = runtime_of("double", "events")
    code = getattr(library, kind)
    return tuple(library.ncgen_side_of(code, number) for number in range(library.ncgen_loads_of(code)))


def is_still(velocity: float, terms: float, drift: float = 0.0) -> bool:
    """Whether something does not move, but for rounding, whose velocity consists of terms and a drift."""
    return bool(runtime_of("double", "events").ncgen_is_still(velocity, terms, drift))


def is_missed(jacobian: csr_array, nu: np.ndarray, sizes: np.ndarray, speed: float, qd: np.ndarray) -> bool:
    """Whether velocities qd (n,) miss Φ_q q̇ = ν by more than rounding, so that a lock cannot close.

    jacobian (m, n): Φ_q; nu (m,); sizes (n,): natural sizes of coordinates; speed: the largest velocity before (1/s) in these
    """
    ffi = interface_of("double")
    arrays = {name: np.array(getattr(jacobian, name), dtype=np.intc) for name in ("indptr", "indices")}
    members = {name: pointer(ffi, array, "int[]") for name, array in arrays.items()}
    pattern = ffi.new("ncgen_pattern *", {"rows": len(nu), "columns": len(qd), **members})
    values, nu_in_c, sizes_in_c, qd_in_c = (pointer(ffi, np.ascontiguousarray(each)) for each in (jacobian.data, nu, sizes, qd))
    return bool(runtime_of("double", "events").ncgen_is_missed(pattern, values, nu_in_c, sizes_in_c, speed, qd_in_c))


def leaves_none(mobility: float, whole: float) -> bool:
    """Whether nothing can move along a direction of whose mobility with nothing held, `whole`, this is left."""
    return bool(runtime_of("double", "events").ncgen_is_blocked(mobility, whole))
