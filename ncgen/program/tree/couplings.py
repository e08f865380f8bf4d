"""Joints of a tree that follow others: mimics of robots' files, gears between measured coordinates.

A row between the measured coordinates of two joints says that one of them follows the other at a constant ratio. All that follow one joint,
and this one, move as one: a group, whose links hang on the same link, its carrier, or on one another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ncgen.program.ir.blocks import Pattern
from ncgen.symbolic.tree import Tree


class NoTables(Exception):
    """The tree is not open, or moves otherwise than its tables would say; the reason in words."""


RELATIVE_TOLERANCE = 1e-9
"""What differs less than this, over its size, is the same; and what is smaller is 0."""


@dataclass(frozen=True)
class Couplings:
    """leaders: {screw: (the screw that it follows, how much faster it is)}, of the nearest to the ground that all of a group follow
    groups: of every link, the number of its group or -1; carriers: of every group, the link that carries it, -1 for the ground
    """

    leaders: dict[int, tuple[int, float]]
    groups: list[int]
    carriers: list[int]


def followed(rows: Sequence[Sequence[int]], pattern: Pattern, values: np.ndarray, measured: dict[int, tuple[int, float]]) -> dict:
    """{screw: (screw nearer to the ground, ratio)} of rows that couple the measured coordinates of two joints.

    rows: their coordinates, of each row of Φ; values (places, nonzeros): of Φ_q
    Raises NoTables where a row says anything else of measured coordinates alone.
    """
    followers: dict[int, tuple[int, float]] = {}
    for r, row in enumerate(rows):
        if not row or any(c not in measured for c in row):
            continue
        if len(row) != 2:
            raise NoTables("rows close loops")
        terms = [(measured[c][0], values[:, pattern.indptr[r] + k] * measured[c][1]) for k, c in enumerate(row)]
        (leader, one), (screw, other) = sorted(terms, key=lambda term: term[0])
        ratios = -one / other if np.all(np.abs(other) > 0) else np.array([np.nan])
        if screw == leader or screw in followers or not np.all(np.abs(ratios - ratios[0]) <= RELATIVE_TOLERANCE * np.abs(ratios[0])):
            raise NoTables("a joint follows others, and not at a constant ratio")
        followers[screw] = (leader, float(ratios[0]))
    return followers


def couplings(tree: Tree, pairs: dict[int, tuple[int, float]]) -> Couplings:
    """The groups of joints that follow one another; pairs: as `followed` finds them. Raises NoTables where a group has several carriers."""
    leaders: dict[int, tuple[int, float]] = {}
    for screw, (before, ratio) in sorted(pairs.items()):
        first, more = leaders.get(before, (before, 1.0))
        leaders[screw] = (first, ratio * more)
    links = {k: number for number, rates in enumerate(tree.rates) for k in rates}
    groups, carriers = [-1] * len(tree.links), []
    for first in sorted({leader for leader, _ in leaders.values()}):
        members = {links[first], *(links[k] for k, (leader, _) in leaders.items() if leader == first)}
        outside = {tree.links[member].parent for member in members} - members
        if len(outside) != 1 or any(len(tree.rates[member]) != 1 for member in members):
            raise NoTables("joints that follow one another hang on several bodies")
        (carrier,) = outside
        for member in members:
            groups[member] = len(carriers)
        carriers.append(-1 if carrier is None else carrier)
    return Couplings(leaders, groups, carriers)
