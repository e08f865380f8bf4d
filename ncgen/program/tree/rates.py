"""The rates of a mechanism's tree, and the rows that are left of its constraints over them.

Unknowns are the rates of the tree's joints, of coordinates that belong to no body of the tree, and of independent coordinates of
bodies. Elements move with q̇ = T x, so rows that a rigid motion satisfies say nothing, and what is left of the others is J x = ν with
J = Φ_q T. Which rows and which entries vanish, and which angles are simply those of a joint, is seen in sample positions.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ncgen.model.elements import Point, Relative, Spatial
from ncgen.model.singular_values import rank_above, singular_values
from ncgen.program.algebra.pivoting import column_order
from ncgen.program.algebra.space import Vector
from ncgen.program.ir.graph import ArrayElement
from ncgen.program.ir.sampling import Sample, Sampling
from ncgen.program.kernel_table import KERNELS
from ncgen.program.lines import Lines
from ncgen.program.programs import Split
from ncgen.program.tree.tree_motion import Loads, TreeGeometry, add_force
from ncgen.symbolic.numbering import Terms
from ncgen.symbolic.tree import Tree, moving

ENTRY_ROUNDING = 1e-11
"""An entry below this share of its row, in its natural sizes, is 0 by the way bodies move."""

POSITION_ROUNDING = 16 * np.finfo(float).eps
"""The same for every mechanism's length between it and the origin: so badly do its positions close there."""

RATIO_TOLERANCE = 1e-10
"""A ratio of entries that differs by less than this, over its size, from what it is to be in every sample is that always."""

MIN_SINGULAR_VALUE = 1e-9
"""The least singular value of the rows of the rates, over the largest."""

RATHER_FREE = 0.5
"""The weight of a measured coordinate beside other rates where dependent ones are chosen."""


class NoRecursion(Exception):
    """The recursion does not say what the equations say; the reason in words."""


def check_samples(equations: Terms, samples: Sequence[Sample]) -> None:
    """Raise NoRecursion where samples cannot tell what depends on parameters, since they have the same ones."""
    if equations.parameters and len({sample.p.tobytes() for sample in samples}) < 2:
        raise NoRecursion("there are no positions with other parameters")


@dataclass(frozen=True)
class RateRow:
    """A row of the rates: {unknown: node}, and where its right-hand sides come from.

    source: the number of the row of Φ, or (element, link) whose component `axis` moves with a link; None where both sides are 0
    """

    entries: dict[int, int]
    source: int | tuple[Spatial, int] | None
    axis: int = 0


class Rates:
    """Unknowns 0 … count − 1: of joints first, then of coordinates in `own`.

    where: {coordinate: (element, axis)} of coordinates that move with a link; own: {coordinate: unknown} of those with a rate of their own
    free: unknowns of the independent coordinates in their order, dependent: all others; sizes: natural size of every rate
    split: the independent coordinates, or None where `choose` says which rates are free
    """

    def __init__(
        self, equations: Terms, lines: Lines, tree: Tree, split: Split | None, samples: Sequence[Sample], sizes: np.ndarray
    ) -> None:
        self.equations, self.tree, self.natural = equations, tree, sizes
        self.graph, self.geometry = lines.graph, TreeGeometry(lines, tree)
        self.sampling = Sampling(lines.graph, samples)
        away = max(float(np.max(np.abs(sample.q) / sizes, initial=0.0)) for sample in samples)
        self.vanishing = max(ENTRY_ROUNDING, POSITION_ROUNDING * away)
        self.where = moving(equations, tree)
        joints = len(self.geometry.columns)
        independent = split.independent if split else ()
        remaining = [c for c in range(len(equations.free)) if c not in self.where or c in independent]
        self.own = {c: joints + k for k, c in enumerate(remaining)}
        self.count = joints + len(remaining)
        self.free = [self.own[c] for c in independent]
        measured = {component for e in equations.model.elements.values() if isinstance(e, Relative) for component in e.components}
        self.measured = {k for c, k in self.own.items() if equations.free[c] in measured}
        self.length = max((sizes[c] for c, (e, _) in self.where.items() if isinstance(e, Point)), default=1.0)
        self.sizes = np.array([*(self._size(column.axis) for column in self.geometry.columns), *(sizes[c] for c in remaining)])
        self.jacobian: dict[int, dict[int, int]] = defaultdict(dict)
        for (r, c), node in sorted(lines.matrix(KERNELS["phi_q"]).items()):
            self.jacobian[r][c] = node

    @property
    def dependent(self) -> list[int]:
        return sorted(set(range(self.count)) - set(self.free))

    def _size(self, axis: Vector) -> float:
        """1 of a rate that turns, else the length of the mechanism."""
        return 1.0 if any(self.graph.value(node) != 0.0 for node in axis) else self.length

    def rows(self) -> list[RateRow]:
        """All that is not satisfied by the way bodies move."""
        rows = [self._constraint(r, entries) for r, entries in self.jacobian.items()]
        rows += [row for number, link in enumerate(self.tree.links) for e in link.body.elements for row in self._carried(e, number)]
        return [row for row in rows if row.entries]

    def _constraint(self, number: int, entries: dict[int, int]) -> RateRow:
        """A row of Φ over the rates: what it does to each body is a force and a moment, which add up along the tree."""
        loads: Loads = {}
        row: dict[int, int] = {}
        for c, node in entries.items():
            if c in self.where:
                self.load(loads, c, node)
            else:
                row[self.own[c]] = node
        row |= self.geometry.inward(loads, {})
        scale = max(float(np.max(np.abs(self.sampling[node]))) * self.natural[c] for c, node in entries.items())
        row = self._nonzero(row, scale)
        snapped = self._constant(row)
        return RateRow(snapped, None) if snapped else RateRow(row, number)

    def load(self, loads: Loads, c: int, node: int) -> None:
        """Add a generalised force along a coordinate to force and moment on its link."""
        add_force(self.geometry, loads, *self.where[c], node)

    def _carried(self, element: Spatial, link: int) -> list[RateRow]:
        """An element that a link shares with another one that carries it, or that is held, moves as that one says; and where a
        coordinate is independent, its rate is that of the element."""
        home = self.tree.home.get(element)
        own_motion = self.geometry.moved(element, link)
        home_motion = self.geometry.moved(element, home) if home is not None and home != link else {}
        zero, reach = self.graph.const(0.0), self.length if isinstance(element, Point) else 1.0
        rows = []
        for axis, component in enumerate(element.components):
            entries = {k: v[axis] for k, v in own_motion.items()}
            entries |= {k: self.graph.sub(entries.get(k, zero), v[axis]) for k, v in home_motion.items()}
            entries = self._nonzero(entries, reach)
            if home == link and self.equations.moves(component):
                c = self.equations.index[component]
                if c not in self.own:
                    continue
                entries[self.own[c]] = self.graph.const(-1.0)
            rows.append(RateRow(entries, (element, link), axis))
        return rows

    def _nonzero(self, entries: dict[int, int], scale: float) -> dict[int, int]:
        """Entries that are more than rounding in some sample; scale: of the row."""
        least = self.vanishing * scale
        return {k: node for k, node in entries.items() if np.max(np.abs(self.sampling[node])) * self.sizes[k] > least}

    def _constant(self, row: dict[int, int]) -> dict[int, int] | None:
        """The row of a measured coordinate with the ratios of its entries, where these never change: its rate is that of joints."""
        measured = [k for k in row if k in self.measured]
        if len(measured) != 1 or len(row) < 2 or not np.all(np.abs(self.sampling[row[measured[0]]]) > 0):
            return None
        ratios = {k: self._ratio(node, row[measured[0]]) for k, node in row.items()}
        known_ratios = {k: ratio for k, ratio in ratios.items() if ratio is not None}
        return known_ratios if len(known_ratios) == len(row) else None

    def _ratio(self, a: int, b: int) -> int | None:
        """a/b as a number or of parameters alone; None where it changes with the position."""
        values = self.sampling[a] / self.sampling[b]
        if not np.all(np.abs(values) > 0):
            return None
        sign = float(np.sign(values[0]))
        if np.max(np.abs(values - sign)) <= RATIO_TOLERANCE:
            return self.graph.const(sign)
        ratio = self.graph.div(self.described(a), self.described(b))
        return ratio if np.max(np.abs(self.sampling[ratio] - values) / np.abs(values)) <= RATIO_TOLERANCE else None

    def described(self, node: int) -> int:
        """A node in the position that is described: of parameters alone."""
        return self.graph.replaced(node, self._start)

    @cached_property
    def _start(self) -> dict[ArrayElement, int]:
        return {ArrayElement("q", c): self.geometry.lines.value(component.value) for c, component in enumerate(self.equations.free)}

    def nonzero_column(self, column: dict[int, int]) -> dict[int, int]:
        """{rate: node} without what is rounding in every sample."""
        return {k: node for k, node in column.items() if np.max(np.abs(self.sampling[node])) / self.sizes[k] > self.vanishing}

    def _numbers(self, rows: list[RateRow]) -> np.ndarray:
        """The rows without units in all samples (samples, rows, count); with numbers for parameters they would be as large."""
        matrices = np.zeros((self.sampling.count, len(rows), self.count))
        for i, row in enumerate(rows):
            for k, node in row.entries.items():
                matrices[:, i, k] = self.sampling[node] * self.sizes[k]
        largest = np.max(np.abs(matrices), axis=2, initial=1e-300)
        largest_alike = np.max(largest[self.sampling.alike], axis=0)
        return matrices / np.where(largest_alike > 1e-300, largest_alike, np.max(largest, axis=0))[None, :, None]

    def choose(self, rows: list[RateRow], weights: Mapping[int, float] | None = None) -> None:
        """Let those rates be free that determine the others best in the first sample.

        weights: of rates, 1 for others; the smaller, the sooner a rate is free; None for measured coordinates, whose rates are known
        """
        weights = dict.fromkeys(self.measured, RATHER_FREE) if weights is None else weights
        matrices = self._numbers(rows)
        rank = max(int(rank_above(matrix, 10 * MIN_SINGULAR_VALUE)) for matrix in matrices) if rows else 0
        scale = np.array([weights.get(k, 1.0) for k in range(self.count)])
        order = column_order(matrices[0] * scale)
        self.free = sorted(order[rank:].tolist())

    def kept(self, rows: list[RateRow]) -> list[RateRow]:
        """As many rows as there are dependent rates, independent in every sample. Raises NoRecursion where there are none."""
        dependent, matrices = self.dependent, self._numbers(rows)
        if len(rows) < len(dependent):
            raise NoRecursion(f"{len(rows)} rows for {len(dependent)} dependent rates")
        order = column_order(matrices[0][:, dependent].T)
        taken = sorted(order[: len(dependent)].tolist())
        for matrix in matrices:
            values = singular_values(matrix[np.ix_(taken, dependent)])
            if len(dependent) and (
                not values[-1] > MIN_SINGULAR_VALUE * values[0] or rank_above(matrix, 10 * MIN_SINGULAR_VALUE) > len(dependent)
            ):
                raise NoRecursion("the tree does not move as the rows allow")
        return [rows[i] for i in taken]
