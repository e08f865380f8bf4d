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


def missed_speed(change: float) -> float:
    """The sliding velocity (m/s) that steps may miss around rest, which unseen velocities change by so much."""
    return float(_library().ncgen_missed_speed(change, 0))


def first_length(deceleration: float, size: float, missed: float) -> float:
    """How long the direction is in which a contact in space begins to slide."""
    return float(_library().ncgen_first_length(deceleration, size, missed))


def largest_slide(so_far: float, speed: float, terms: float) -> float:
    """The largest velocity (m/s) that is known of a slide, by the one so far, the present one, and its terms."""
    return float(_library().ncgen_largest_slide(so_far, speed, terms))
