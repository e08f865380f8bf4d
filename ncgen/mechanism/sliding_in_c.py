"""The rules of what slides with friction in C (ncgen_sliding.h): whether its loads are determined, coming to rest in space."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.runtime_library import interface_of, runtime_of
from ncgen.toolchain.abi import InC


def _library() -> InC:
    return runtime_of("double", "events")


def parts(count: int) -> Iterator[tuple[int, ...]]:
    """Parts of things that slide, those of fewer things first, whose loads are to be determined; the empty part is left out."""
    chosen = np.zeros(count, dtype=np.intc)
    while _library().ncgen_next_part(count, pointer(interface_of("double"), chosen, "int[]")):
        yield tuple(np.flatnonzero(chosen).tolist())


def is_positive(determinant: float, plain: float = 1.0) -> bool:
    """Whether the loads of a part are determined, by its determinant and that without friction."""
    return bool(_library().ncgen_is_positive(determinant, plain))


def unseen_velocities(tolerances: tuple[float, float], step: float, sizes: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Velocities (n,) that steps do not tell from none.

    tolerances: rtol and atol, or zeros for steps of a fixed length (s); sizes, qd, qdd (n,): natural sizes of coordinates, velocities and
    accelerations
    """
    unseen = _library().ncgen_unseen_velocity
    return np.array([unseen(*tolerances, step, *each) for each in zip(sizes.tolist(), qd.tolist(), qdd.tolist(), strict=True)])


class SlidingContact:
    """A contact that touches, at a moment, as of `ncgen_slide`.

    velocity (d,): at which it slides (m/s), d being 1 in the plane and 2 in space; gradients (d, n): its derivatives by q̇; slip (d,): its
    direction so far; sizes, unseen (n,): natural sizes of coordinates, and velocities that steps do not tell from none
    """

    def __init__(self, velocity: np.ndarray, gradients: np.ndarray, slip: np.ndarray, sizes: np.ndarray, unseen: np.ndarray) -> None:
        self.velocity, self.gradients, self.slip = velocity, gradients, slip
        arrays = {"velocity": velocity, "gradients": gradients, "slip": slip, "sizes": sizes, "unseen": unseen}
        self._ffi = interface_of("double")
        self._arrays = {name: np.array(array, dtype=float) for name, array in arrays.items()}
        members = {name: pointer(self._ffi, array) for name, array in self._arrays.items()}
        self.in_c: InC = self._ffi.new("ncgen_slide *", members | {"n": len(sizes), "directions": len(velocity)})

    def is_still(self, speed: float) -> bool:
        """Whether it does not slide, but for rounding, at most this velocity in natural sizes being the greatest."""
        return bool(_library().ncgen_slide_is_still(self.in_c, speed))

    @property
    def is_unseen(self) -> bool:
        """Whether it is slower than steps may miss around rest."""
        return bool(_library().ncgen_slide_is_unseen(self.in_c))

    def along(self, way: np.ndarray, change: np.ndarray) -> float:
        """How far a change of velocities (n,) goes along the direction (d,) in which it begins to slide."""
        return float(_library().ncgen_along_slide(self.in_c, *(self._ffi.new("double[]", each.tolist()) for each in (way, change))))
