"""The tables of an open tree as C reads them (`ncgen_tree` in ncgen_runtime.h)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ncgen.model.elements import Point
from ncgen.program.tree.tree_tables import OpenTree

LEAST_MEMBERS = 3
"""Members that every body has in the tables: with this number, which most have, loops over them need no branches."""


@dataclass(frozen=True, eq=False)
class TreeTables:
    """The members of `ncgen_tree` by their names."""

    counts: dict[str, int]
    indices: dict[str, list[int]]
    numbers: dict[str, list[float]]

    def plain(self) -> dict[str, Any]:
        """The tables as JSON can say them, without numbers of NumPy."""
        indices = {name: list(map(int, values)) for name, values in self.indices.items()}
        numbers = {name: list(map(float, values)) for name, values in self.numbers.items()}
        return {"counts": self.counts, "indices": indices, "numbers": numbers}


def tables_of(tree: OpenTree) -> TreeTables:
    """As C reads them."""
    links, screws, coupled = range(len(tree.tree.links)), range(len(tree.screws)), tree.coupled
    per_link = np.bincount(tree.home, minlength=len(links)) if tree.home else np.zeros(len(links), dtype=int)
    members = _members(tree)
    meters = {k: number for number, (k, _) in enumerate(tree.measured.values())}
    counts = {
        "n_links": len(links), "n_screws": len(tree.screws), "n_elements": len(tree.elements), "n_fixed": len(tree.fixed),
        "n_measured": len(tree.measured), "n_rotors": len(tree.masses.rotors),
        "n_groups": len(tree.coupled.carriers), "n_closing": len(tree.closing),
        "n_copies": len(tree.sizes) - tree.n, "n_opposed": len(tree.opposed),
        "most_rows": max(map(len, tree.closes)),
    }  # fmt: skip
    indices = {
        "parent": [-1 if link.parent is None else link.parent for link in tree.tree.links],
        "reference": _flat(tree.references),
        "screw_start": _starts([len(rates) for rates in tree.own]),
        "turns": [int(screw.point is not None) for screw in tree.screws],
        "is_carried": [int(not screw.is_constant) for screw in tree.screws],
        "term_start": _starts([len(terms) for terms in tree.terms]),
        "terms": [c for terms in tree.terms for _, components in terms for c in components],
        "element_start": _starts(per_link.tolist()),
        "elements": _flat(tree.components),
        "pair_start": _starts(_count(len(links), [pair[0] for pair in tree.masses.pairs])),
        "member_start": _starts([len(each) for each in members]),
        "members": [c for each, link in zip(members, links, strict=True) for e in each for c in _components(tree, link, e)],
        "pairs": _flat([(_place(members[link], a), _place(members[link], b), value) for link, a, b, value in tree.masses.pairs]),
        "single_start": _starts(_count(len(links), [single[0] for single in tree.masses.singles])),
        "singles": _flat([single[1:] for single in tree.masses.singles]),
        "measured": _flat([(c, k) for c, (k, _) in tree.measured.items()]),
        "meter": [meters.get(k, -1) for k in screws],
        "leader": [coupled.leaders[k][0] if k in coupled.leaders else -1 for k in screws],
        "coupling": coupled.groups,
        "carrier": coupled.carriers,
        "rotors": _flat([rotor[:2] for rotor in tree.masses.rotors]),
        **_row_indices(tree),
    }
    numbers = {
        "weights": [weight for terms in tree.terms for weight, _ in terms],
        "is_point": [_is_point(tree, e) for e in range(len(tree.elements))],
        "heaviness": tree.heaviness,
        "member_is_point": [1.0 if e is None else _is_point(tree, e) for each in members for e in each],
        "ratios": [ratio for _, ratio in tree.measured.values()],
        "ratio": [coupled.leaders[k][1] if k in coupled.leaders else 1.0 for k in screws],
        "pair_shares": tree.masses.pair_shares,
        "single_shares": tree.masses.single_shares,
        "gears": [rotor[2] for rotor in tree.masses.rotors],
        "fixed": [component.initial for component in tree.fixed],
    }
    return TreeTables(counts, indices, numbers)


def _row_indices(tree: OpenTree) -> dict[str, list[int]]:
    """Of the rows that close links, and of those that close loops."""
    closing_entries, products = _closing(tree)
    implied = [row for row in tree.opposed if row not in tree.closing]
    rows_of_loops = [*tree.closing, *implied]
    ways = [_way(tree, row) for row in rows_of_loops]
    return {
        "row_start": _starts([len(rows) for rows in tree.closes]),
        "rows": _flat([list(rows) for rows in tree.closes]),
        "slot_start": _starts([len(slots) for rows in tree.closes for slots in rows.values()]),
        "slots": [slot for rows in tree.closes for slots in rows.values() for slot in slots],
        "closing": rows_of_loops,
        "way_start": _starts([len(way) for way in ways]),
        "way": _flat(ways),
        "reach_start": _starts([len(_reach(tree, way)) for way in ways]),
        "reach": _flat([_reach(tree, way) for way in ways]),
        "own_start": _starts([len(entries) for entries in closing_entries]),
        "own": _flat(closing_entries),
        "entry_start": _starts([len(rows) * (len(rows) + 1) // 2 for rows in tree.closes]),
        "product_start": _starts([len(terms) for terms in products]),
        "products": _flat([pair for terms in products for pair in terms]),
    }


def _is_point(tree: OpenTree, element: int) -> float:
    return float(isinstance(tree.elements[element], Point))


def _members(tree: OpenTree) -> list[list[int | None]]:
    """Of every link, elements between which its body has mass that is the same along all axes, without the reference point; at least
    LEAST_MEMBERS, of which None is the reference point without mass."""
    elements: list[set[int]] = [set() for _ in tree.tree.links]
    for link, a, b, _ in tree.masses.pairs:
        elements[link] |= {e for e in (a, b) if tree.components[e] != tree.references[link]}
    return [[*sorted(each), *[None] * (LEAST_MEMBERS - len(each))] for each in elements]


def _components(tree: OpenTree, link: int, element: int | None) -> list[int]:
    return tree.references[link] if element is None else tree.components[element]


def _place(members: Sequence[int | None], element: int) -> int:
    """The number of a member; of the reference point the one behind the last."""
    return members.index(element) if element in members else len(members)


def _closing(tree: OpenTree) -> tuple[list[list[int]], list[list[tuple[int, int]]]]:
    """Of every row, link by link, the entries of Φ_q that stand for coordinates and copies of its link, and of every product of two rows,
    below the diagonal and on it, the pairs of entries that it consists of."""
    closing_entries: list[list[int]] = []
    products: list[list[tuple[int, int]]] = []
    for rows, unknowns in zip(tree.closes, map(set, tree.unknowns), strict=True):
        entries = [{c: tree.pattern.indptr[r] + k for k, c in enumerate(slots) if c in unknowns} for r, slots in rows.items()]
        closing_entries += [list(each.values()) for each in entries]
        products += [[(s, other[c]) for c, s in one.items() if c in other] for i, one in enumerate(entries) for other in entries[: i + 1]]
    return closing_entries, products


def _way(tree: OpenTree, row: int) -> list[int]:
    """The links that a closing row's coordinates move with, and those before them, the last first."""
    screws = {k: link for link, rates in enumerate(tree.own) for k in rates}
    touched = {tree.home[tree.where[c][0]] if c in tree.where else screws[tree.measured[c][0]] for c in tree.rows[row]}
    return sorted({link for each in touched for link in tree.tree.chain(each)}, reverse=True)


def _reach(tree: OpenTree, way: Sequence[int]) -> list[int]:
    """The screws of some links, and behind them all the groups to which links belong."""
    groups = {tree.coupled.groups[link] for link in way} - {-1}
    return [*(k for link in way for k in tree.own[link]), *(len(tree.screws) + group for group in sorted(groups))]


def _starts(lengths: Sequence[int]) -> list[int]:
    return [0, *np.cumsum(lengths, dtype=int).tolist()]


def _flat(rows: Sequence[Sequence[int]]) -> list[int]:
    return [number for row in rows for number in row]


def _count(size: int, numbers: Sequence[int]) -> list[int]:
    return np.bincount(np.array(numbers, dtype=int), minlength=size).tolist()
