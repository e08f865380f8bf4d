"""The laws of impact, and velocities that are set, in C, as arrays (ncgen_impulses.h, ncgen_rates.h)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from ncgen.mechanism.arguments import pointer
from ncgen.mechanism.runtime_library import interface_of, runtime_of
from ncgen.toolchain.abi import InC

Law = Literal["NCGEN_NO_LAW", "NCGEN_SIMULTANEOUS", "NCGEN_IN_TURN"]

Failure = Literal["NCGEN_SINGULAR", "NCGEN_NO_ORDER", "NCGEN_NO_IMPULSES", "NCGEN_GAIN", "NCGEN_ENDLESS"]

FAILURES: tuple[Failure, ...] = ("NCGEN_SINGULAR", "NCGEN_NO_ORDER", "NCGEN_NO_IMPULSES", "NCGEN_GAIN", "NCGEN_ENDLESS")

LAWS: dict[str, Law] = {"": "NCGEN_NO_LAW", "simultaneous": "NCGEN_SIMULTANEOUS", "in turn": "NCGEN_IN_TURN"}
"""Laws of several impacts at one instant, in C, in the order of their numbers in ncgen_event_table.h."""


class Blow(NamedTuple):
    """A contact: the place of its gap among the velocities, behind which stand those of its directions of sliding; coefficients"""

    gap: int
    directions: int
    is_poisson: bool
    restitution: float
    friction: float
    tangential: float


@dataclass(frozen=True, eq=False, kw_only=True)
class ImpactInC:
    """What C has of an impact of k contacts with r velocities.

    failure: None where all went well; which: the contact that it is about, or −1; closes: whether a gap did; velocities, impulses (r,);
    sticks (k,); lost (k,): J; turns: contact and impulses (r,) of each impact in turn; count: of these
    """

    failure: Failure | None
    which: int
    closes: bool
    velocities: np.ndarray
    impulses: np.ndarray
    sticks: np.ndarray
    lost: np.ndarray
    turns: tuple[tuple[int, np.ndarray], ...]
    count: int


def are_coupled(G: np.ndarray, blows: list[Blow]) -> bool:
    """Whether an impulse of one contact changes a velocity of another one. G (r, r): responses of velocities to impulses"""
    ffi, library = interface_of("double"), runtime_of("double", "events")
    numbers = {"G": np.ascontiguousarray(G), "coefficients": np.array([each[3:] for each in blows])}
    integers = np.array([each[:3] for each in blows], dtype=np.intc)
    members = {name: pointer(ffi, array) for name, array in numbers.items()} | {"places": pointer(ffi, integers, "int[]")}
    return bool(library.ncgen_are_coupled(ffi.new("ncgen_impact *", {"count": len(blows), "rows": len(G)} | members)))


def impact(G: np.ndarray, velocities: np.ndarray, blows: list[Blow], law: Law, terms: np.ndarray, energy: float) -> ImpactInC:
    """The impact of contacts whose gaps are closed; nothing happens unless one closes.

    G (r, r): responses of velocities to impulses; velocities (r,), sums of terms (r,); energy: kinetic (J)
    """
    ffi, library = interface_of("double"), runtime_of("double", "events")
    rows, count = len(velocities), len(blows)
    numbers = {"G": np.ascontiguousarray(G), "coefficients": np.array([each[3:] for each in blows]), "terms": terms}
    numbers |= {"velocities": velocities.copy(), "impulses": np.zeros(rows), "lost": np.zeros(count)}
    numbers["workspace"] = np.zeros(library.ncgen_impact_workspace(rows))
    integers = {"places": np.array([each[:3] for each in blows], dtype=np.intc), "sticks": np.zeros(count, dtype=np.intc)}
    if law == "NCGEN_IN_TURN":
        integers["turns"] = np.zeros(library.NCGEN_MOST_TURNS, dtype=np.intc)
        numbers["pushes"] = np.zeros((library.NCGEN_MOST_TURNS, 3))
    members = {name: pointer(ffi, array) for name, array in numbers.items()}
    members |= {name: pointer(ffi, array, "int[]") for name, array in integers.items()}
    whole = {"count": count, "rows": rows, "law": getattr(library, law), "energy": energy}
    struct: InC = ffi.new("ncgen_impact *", whole | members)
    status = library.ncgen_impact_of_gaps(struct)
    failure: Failure | None = next((name for name in FAILURES if status == getattr(library, name)), None)
    turns = []
    for k in range(struct.n_turns if law == "NCGEN_IN_TURN" and not failure else 0):
        blow, pushes = blows[(number := int(integers["turns"][k]))], np.zeros(rows)
        pushes[blow.gap : blow.gap + 1 + blow.directions] = numbers["pushes"][k, : 1 + blow.directions]
        turns.append((number, pushes))
    return ImpactInC(
        failure=failure,
        which=struct.which,
        closes=bool(struct.closes),
        velocities=numbers["velocities"],
        impulses=numbers["impulses"],
        sticks=integers["sticks"] > 0,
        lost=numbers["lost"],
        turns=tuple(turns),
        count=struct.n_turns,
    )


def set_rates(responses: np.ndarray, positions: list[int], wanted: np.ndarray, qd: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, int]:
    """Velocities (n,) of which those at some places (k,) are what is wanted, by the least kinetic energy of the change.

    responses (n, k): changes by unit impulses along these; qd, sizes (n,). Returns also the number of the place that cannot become that,
    or −1.
    """
    ffi, after, transposed = interface_of("double"), qd.copy(), np.ascontiguousarray(responses.T)
    numbers = [pointer(ffi, np.ascontiguousarray(each)) for each in (wanted, sizes, transposed, after)]
    chosen = pointer(ffi, np.array(positions, dtype=np.intc), "int[]")
    failed = runtime_of("double", "events").ncgen_set_rates(len(qd), len(positions), chosen, 1, *numbers)
    return after, int(failed)
