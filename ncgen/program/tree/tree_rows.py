"""Which link of a tree of bodies every row of Φ closes, in numbers.

What two bodies share at the end of a loop stands with one of them, its home. The rows of the other one then close the loop. To say where
that body's own coordinates are, its link has a copy of what it shares: such rows hold for the copies whatever the joints do.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ncgen.model.singular_values import least_squares, rank_above
from ncgen.program.algebra.inertia_matrix import least_inertia
from ncgen.program.ir.blocks import Pattern
from ncgen.program.tree.couplings import RELATIVE_TOLERANCE, Couplings, NoTables, couplings
from ncgen.program.tree.tree_velocities import TreeVelocities
from ncgen.symbolic.numbering import Numbering
from ncgen.symbolic.tree import Tree

RANDOM = 2
"""Random rates of all joints that every row is tried with."""

ENTRY_ROUNDING = 1e-12
"""A row whose entries are below this in all places, in natural sizes, says nothing: it is what rounding leaves of a constant."""


LinkEntries: TypeAlias = tuple[list[int], np.ndarray, np.ndarray]
"""Rows that close a link, and what their entries over its own slots and over others are, each shape (4, entries): number of the row among
these, column among the own slots, number of the value, slot."""


@dataclass(frozen=True, eq=False)
class SampledPosition:
    """A position q (n,), Φ there (m,) in natural sizes, and values of Φ_q and M."""

    q: np.ndarray
    phi: np.ndarray
    phi_q: np.ndarray
    mass: np.ndarray


@dataclass(frozen=True, eq=False)
class Around:
    """What the kernels say of a mechanism.

    q (n,): where it is; looks: of a position, for one or several sets of parameters; rows (m,), columns (n,): natural sizes
    """

    q: np.ndarray
    looks: Sequence[Callable[[np.ndarray], SampledPosition]]
    rows: np.ndarray
    columns: np.ndarray


class TreeRows(TreeVelocities):
    """A tree of bodies with its rows.

    rows: their coordinates; closing: those that joints do not satisfy, so that they close loops; vanishing: those that say nothing
    group: of every coordinate the link that closes it; copies: {(link, coordinate): number of its copy behind the coordinates}
    closes: of every link the rows that close it, each with what its entries stand for, coordinates or copies
    """

    def __init__(self, numbering: Numbering, tree: Tree, pattern: Pattern, around: Around) -> None:
        super().__init__(numbering, tree)
        self.pattern, self.around = pattern, around
        self.coupled: Couplings = couplings(self.tree, {})
        self.closing: list[int] = []
        self.vanishing: set[int] = set()
        self.copies: dict[tuple[int, int], int] = {}
        self.copied: list[tuple[int, int]] = []
        self.copied_rows: list[dict[int, tuple[int, ...]]] = [{} for _ in self.tree.links]
        starts, columns = pattern.indptr, pattern.indices
        self.rows = [columns[starts[r] : starts[r + 1]] for r in range(pattern.shape[0])]
        self.members = [{self.number[e] for e in link.body.elements if e in self.number} for link in self.tree.links]
        self.group = [self.home[self.where[c][0]] if c in self.where else -1 for c in range(self.n)]
        for row in self.rows:
            deepest = max((self.group[c] for c in row if c in self.where), default=-1)
            for c in row:
                if c not in self.where:
                    self.group[c] = max(self.group[c], deepest)
        if -1 in self.group:
            raise NoTables("a coordinate belongs to no body")
        self._lay_out()

    def _lay_out(self) -> None:
        """Which rows close which link, and what."""
        self.closes: list[dict[int, tuple[int, ...]]] = [
            {r: slots for r, slots in rows.items() if r not in self.vanishing} for rows in self.copied_rows
        ]
        left = {*self.closing, *self.vanishing}
        for r, row in enumerate(self.rows):
            if row and r not in left:
                self.closes[max(self.group[c] for c in row)].setdefault(r, row)
        self.unknowns: list[list[int]] = [[] for _ in self.tree.links]
        for c, link in enumerate(self.group):
            self.unknowns[link].append(c)
        copied = {slot: c for (_, c), slot in sorted(self.copies.items(), reverse=True)}
        for slot, link in {slot: link for (link, _), slot in sorted(self.copies.items(), reverse=True)}.items():
            self.unknowns[link].append(slot)
        self._entries_of_links: dict[tuple[int, bool], LinkEntries] = {}
        self.sizes = np.append(self.around.columns, [self.around.columns[copied[slot]] for slot in sorted(copied)])

    # -- copies --------------------------------------------------------------------------------

    def _take_copies(self, sample: SampledPosition) -> None:
        """Give links copies of what moves with them only where loops are closed, and the rows that hold for these."""
        apart = [pair for pair, is_carried in self.moving_together(sample.q, self._random()).items() if not is_carried]
        owners = self._owners(sample.q, apart)
        self.copied = [pair for pair in apart if owners[pair] == pair]
        slots = ((e, link, c) for e, link in self.copied for c in self.components[e] if c < self.n)
        number = {(e, link, c): self.n + k for k, (e, link, c) in enumerate(slots)}
        self.copies = {(link, c): number[*owners[e, link], c] for e, link in apart for c in self.components[e] if c < self.n}
        users: dict[int, list[int]] = defaultdict(list)
        for r, row in enumerate(self.rows):
            for e in {self.where[c][0] for c in row if c in self.where}:
                users[e].append(r)
        self._lay_out()
        moved = self._moved(sample.q, self._random())
        of_bodies = {r for r, row in enumerate(self.rows) if all(c in self.where for c in row)}
        for link, members in enumerate(self.members):
            for r in sorted({r for e in members for r in users[e]} & of_bodies):
                slots = self._slots(link, self.rows[r])
                if slots and self._holds(sample, r, slots, moved):
                    self.copied_rows[link][r] = slots
        self._lay_out()

    def _owners(self, q: np.ndarray, apart: Sequence[tuple[int, int]]) -> dict[tuple[int, int], tuple[int, int]]:
        """Of elements with links that carry them, the first link that carries the element in the same way."""
        velocities = self.carried(q, self._random(), np.array([e for e, _ in apart], dtype=int), [link for _, link in apart])
        owners: dict[tuple[int, int], tuple[int, int]] = {}
        first: dict[int, list[int]] = defaultdict(list)
        for k, (e, link) in sorted(enumerate(apart), key=lambda numbered: numbered[1][1]):
            size = RELATIVE_TOLERANCE * np.max(np.abs(velocities[:, k]))
            same = [other for other in first[e] if np.max(np.abs(velocities[:, other] - velocities[:, k])) <= size]
            owners[e, link] = apart[same[0]] if same else (e, link)
            if not same:
                first[e].append(k)
        return owners

    def _slots(self, link: int, row: Sequence[int]) -> tuple[int, ...]:
        """What the entries of a row stand for where it closes a link: copies of this link and of its parent before coordinates; nothing
        where it says nothing of the link, or is not of them alone, or needs no copies."""
        parent = self.tree.links[link].parent
        before = set() if parent is None else self.members[parent]
        elements = {self.where[c][0] for c in row if c in self.where}
        if not elements <= self.members[link] | before or elements <= before:
            return ()
        slots = tuple(
            self.copies.get((link, c), c if c not in self.where or self._is_member(link, c) else self._of_parent(parent, c)) for c in row
        )
        return slots if max(slots) >= self.n else ()

    def _is_member(self, link: int, c: int) -> bool:
        return self.where[c][0] in self.members[link]

    def _of_parent(self, parent: int | None, c: int) -> int:
        return c if parent is None else self.copies.get((parent, c), c)

    def _holds(self, sample: SampledPosition, row: int, slots: Sequence[int], moved: np.ndarray) -> bool:
        """True where a row allows what the joints do, if its entries stand for these slots; moved (tries, n + copies): their velocities."""
        entries, velocities = sample.phi_q[self.pattern.indptr[row] : self.pattern.indptr[row + 1]], moved[:, list(slots)]
        rounding = ENTRY_ROUNDING * self.around.rows[row] * np.max(np.abs(moved) / self.sizes, axis=1)
        return bool(np.all(np.abs(velocities @ entries) <= RELATIVE_TOLERANCE * (np.abs(velocities) @ np.abs(entries)) + rounding))

    def _moved(self, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Velocities (tries, n + copies) of coordinates, copies behind them, at rates (tries, screws)."""
        moved = np.zeros((len(rates), len(self.sizes)))
        moved[:, : self.n] = self.velocities(q, rates)[:, : self.n]
        if self.copied:
            elements, links = np.array([e for e, _ in self.copied]), [link for _, link in self.copied]
            for (e, link), velocity in zip(self.copied, np.moveaxis(self.carried(q, rates, elements, links), 1, 0), strict=True):
                for axis, c in enumerate(self.components[e]):
                    if c < self.n:
                        moved[:, self.copies[link, c]] = velocity[:, axis]
        return moved

    # -- steps ---------------------------------------------------------------------------------

    def _entries(self, link: int, with_copies: bool) -> LinkEntries:
        """The rows that close a link, and their entries."""
        key = link, with_copies
        if key not in self._entries_of_links:
            rows = {r: slots for r, slots in self.closes[link].items() if with_copies or r not in self.copied_rows[link]}
            column_of = {c: k for k, c in enumerate(self.unknowns[link])}
            of_link, of_others = [], []
            for i, (r, slots) in enumerate(rows.items()):
                for entry, c in enumerate(slots, self.pattern.indptr[r]):
                    (of_link if c in column_of else of_others).append((i, column_of.get(c, 0), entry, c))
            inside, outside = (np.array(each, dtype=int).reshape(-1, 4).T for each in (of_link, of_others))
            self._entries_of_links[key] = list(rows), inside, outside
        return self._entries_of_links[key]

    def rows_of(self, link: int) -> list[int]:
        """The rows that close a link, in the order of `block`."""
        return self._entries(link, True)[0]

    def in_natural_sizes(self, sample: SampledPosition) -> np.ndarray:
        """The values of Φ_q over the sizes of their rows."""
        return sample.phi_q / self.around.rows[self.pattern.rows]

    def block(self, link: int, values: np.ndarray, with_copies: bool = True) -> np.ndarray:
        """Rows that close a link over its own slots, both in natural sizes; values: of Φ_q, in natural sizes of rows."""
        rows, (i, column, entry, c), _ = self._entries(link, with_copies)
        block = np.zeros((len(rows), len(self.unknowns[link])))
        block[i, column] = values[entry] * self.sizes[c]
        return block

    def _step_of_links(self, sample: SampledPosition, with_copies: bool) -> np.ndarray:
        """The smallest change of each link's coordinates (n,), relative to those before it, that closes its rows."""
        step, values = np.zeros(len(self.sizes)), self.in_natural_sizes(sample)
        for link, unknowns in enumerate(self.unknowns):
            rows, _, (i, _, entry, c) = self._entries(link, with_copies)
            right = -sample.phi[rows] - np.bincount(i, values[entry] * step[c], minlength=len(rows))
            block = self.block(link, values, with_copies)
            step[unknowns] = least_squares(block, right, RELATIVE_TOLERANCE) * self.sizes[unknowns]
        return step[: self.n]

    # -- checks --------------------------------------------------------------------------------

    def _random(self) -> np.ndarray:
        """Rates of all joints that have nothing in common, but that some follow others, in natural sizes."""
        return self._rates(np.random.default_rng(3).uniform(0.5, 1.5, (RANDOM, self.freedoms)))

    @property
    def freedoms(self) -> int:
        """Of all joints that follow no others, loops being open."""
        return len(self.screws) - len(self.coupled.leaders)

    def _rates(self, free: np.ndarray) -> np.ndarray:
        """Rates (…, screws) of all joints at those (…, free) of joints that follow no others, in natural sizes."""
        sizes, leaders = self._sizes_of_rates(), self.coupled.leaders
        leading = np.delete(np.arange(len(sizes)), list(leaders))
        rates = np.zeros((*free.shape[:-1], len(sizes)))
        rates[..., leading] = free * sizes[leading]
        for screw, (leader, ratio) in leaders.items():
            rates[..., screw] = free[..., np.searchsorted(leading, leader)] * (ratio * sizes[leader])
        return rates

    def _sizes_of_rates(self) -> np.ndarray:
        """Natural sizes of the rates of all joints: 1 rad/s, or the largest coordinate's."""
        return np.where([screw.point is not None for screw in self.screws], 1.0, np.max(self.around.columns))

    def _rates_of_links(self) -> tuple[np.ndarray, list[int]]:
        """Rates (tries, screws) of the first joint of every link, then of the second and so on, and how many each link has; joints of a
        link that follow the same one count as one."""
        sizes, leaders = self._sizes_of_rates(), self.coupled.leaders
        free = [list(dict.fromkeys(leaders.get(k, (k, 1.0))[0] for k in joint)) for joint in self.own]
        rates = np.zeros((max(map(len, free)), len(sizes)))
        for joint, numbers in zip(self.own, free, strict=True):
            for k in joint:
                leader, ratio = leaders.get(k, (k, 1.0))
                rates[numbers.index(leader), k] = ratio * sizes[leader]
        return rates, list(map(len, free))

    def least_inertia(self, q: np.ndarray, pattern: Pattern, masses: np.ndarray) -> float:
        """How far the mass matrix of the joints is from a motion without inertia: see `inertia_matrix`. It is found for each link on the
        ground with all that it carries, at once.

        pattern, masses: of M at q
        """
        roots, leaders = self._roots(), self.coupled.leaders
        joints: dict[int, list[int]] = defaultdict(list)
        leading = (link for link, joint in enumerate(self.own) for k in joint if k not in leaders)
        for number, link in enumerate(leading):
            joints[roots[link]].append(number)
        one_each = np.zeros((max(map(len, joints.values()), default=0), self.freedoms))
        for numbers in joints.values():
            one_each[range(len(numbers)), numbers] = 1.0
        moved = self.velocities(q, self._rates(one_each))[:, : self.n]
        momenta, roots_of_coordinates = np.array([pattern.times(masses, v) for v in moved]), np.array(roots)[self.group]
        parts = ((len(numbers), roots_of_coordinates == root) for root, numbers in joints.items())
        return min((least_inertia(momenta[:count, inside] @ moved[:count, inside].T) for count, inside in parts), default=1.0)

    def _roots(self) -> list[int]:
        """Of every link the one on the ground that carries it, the first one of those whose joints follow one another."""
        roots: list[int] = []
        for number, link in enumerate(self.tree.links):
            roots.append(number if link.parent is None else roots[link.parent])
        for group in range(len(self.coupled.carriers)):
            together = {root for root, other in zip(roots, self.coupled.groups, strict=True) if other == group}
            roots = [min(together) if root in together else root for root in roots]
        return roots

    def _opposed(self, sample: SampledPosition, rows: Sequence[int]) -> list[int]:
        """Those of some rows that do not allow what the joints do. Raises NoTables where joints move a fixed component."""
        opposed: set[int] = set()
        for v in self.velocities(sample.q, self._random()):
            moved, held, least = v[: self.n], v[self.n :], RELATIVE_TOLERANCE * np.max(np.abs(v[: self.n]))
            off = np.abs(self.pattern.times(sample.phi_q, moved))
            terms = self.pattern.times(np.abs(sample.phi_q), np.abs(moved))
            rounding = ENTRY_ROUNDING * self.around.rows * np.max(np.abs(moved) / self.around.columns)
            if np.any(np.abs(held) > least):
                raise NoTables("joints move what is fixed")
            opposed |= {r for r in rows if off[r] > RELATIVE_TOLERANCE * terms[r] + rounding[r]}
        return sorted(opposed)

    def ranks(self, sample: SampledPosition) -> Iterator[tuple[int, int, int]]:
        """Of every link the rank of the rows that close it, how many they are, and what their rank must be."""
        values, scaled = self.in_natural_sizes(sample), []
        for link in range(len(self.unknowns)):
            block = self.block(link, values)
            largest = np.max(np.abs(block), axis=1, initial=0.0)
            scaled.append(block / np.where(largest > RELATIVE_TOLERANCE, largest, 1.0)[:, None])
        for link, (rank, block) in enumerate(zip(ranks_of(scaled), scaled, strict=True)):
            yield rank, len(block), len(self.unknowns[link]) - sum(k not in self.coupled.leaders for k in self.own[link])


def ranks_of(matrices: Sequence[np.ndarray]) -> list[int]:
    """The ranks of matrices whose entries are of order one, those of one shape together."""
    ranks, alike = [0] * len(matrices), defaultdict[tuple[int, ...], list[int]](list)
    for k, matrix in enumerate(matrices):
        alike[matrix.shape].append(k)
    for numbers in alike.values():
        together = np.array([matrices[k] for k in numbers])
        computed = rank_above(together, RELATIVE_TOLERANCE) if together.size else np.zeros(len(numbers), dtype=int)
        for k, rank in zip(numbers, computed.tolist(), strict=True):
            ranks[k] = rank
    return ranks
