"""An open tree of bodies as tables, from which the runtime moves it in loops (`ncgen_tree` in ncgen_runtime.h).

Nothing is emitted for a mechanism, so a tree of a thousand joints compiles nothing, and its motion costs the same for every joint. Tables
are checked on numbers: every row allows what the joints do, nothing else moves, and measured coordinates grow with their joints.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ncgen.model.arithmetic import cross
from ncgen.model.elements import Component, Point, Spatial
from ncgen.model.pairs import Screw
from ncgen.model.values import is_number
from ncgen.program.ir.blocks import Pattern
from ncgen.program.tree.couplings import RELATIVE_TOLERANCE, Couplings, NoTables, couplings, followed
from ncgen.symbolic.numbering import Numbering
from ncgen.symbolic.tree import Tree, by_depth, moving

MASSLESS_FRACTION = 1e-2
"""An element without mass counts as one with this share of the heaviest one's of its link."""

RANDOM = 2
"""Random rates of all joints that every row is tried with."""

POSITION_RESIDUAL = 1e-12
"""The relative residual of a closed position."""

MOST_STEPS = 30
"""Newton steps that close one."""

ENTRY_ROUNDING = 1e-12
"""A row whose entries are below this in all places, in natural sizes, says nothing: it is what rounding leaves of a constant."""

SAMPLE_DISTANCE = 0.05
"""How far the other positions are, in natural sizes."""


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


class OpenTree:
    """A tree of bodies whose joints are all that moves, seen in numbers.

    mass, phi_q: patterns of M and Φ_q
    measured: {coordinate: (number of its screw, how much faster it grows)} of coordinates that no body carries
    Raises NoTables for any other mechanism.
    """

    def __init__(self, numbering: Numbering, tree: Tree, mass: Pattern, phi_q: Pattern, around: Around, closes_loops: bool = False) -> None:
        self.pattern, self.around, self.closes_loops = phi_q, around, closes_loops
        if not tree.links:
            raise NoTables("there are no bodies")
        self.tree = tree = by_depth(tree)
        self.index, self.n = numbering.index, len(numbering.free)
        self.moves = numbering.moves
        self.fixed: dict[Component, int] = {}
        self.elements = sorted(tree.home, key=lambda e: tree.home[e])
        self.number = {element: k for k, element in enumerate(self.elements)}
        self.home = [tree.home[element] for element in self.elements]
        self.where = {c: (self.number[e], axis) for c, (e, axis) in moving(numbering, tree).items()}
        self.screws = [screw for link in tree.links for screw in link.screws]
        self.own = tree.rates
        self.components = [self._components(element) for element in self.elements]
        self.references = [self._components(self._reference(number)) for number in range(len(tree.links))]
        self.terms = [self._terms(screw) for screw in self.screws]
        self.pairs: list[tuple[int, int, int, int]] = []
        self.singles: list[tuple[int, int, int, int, int, int]] = []
        self.rotors: list[tuple[int, int, float]] = []
        self.measured: dict[int, tuple[int, float]] = {}
        self.coupled = couplings(tree, {})
        self.closing: list[int] = []
        self._take_rows()
        samples = self._places()
        self._leave_out(samples)
        self._take_measured(samples)
        self.coupled = self._couplings(samples)
        self._take_masses(mass, samples)
        if closes_loops:
            self._leave_to_loops(self._opposed(samples[0], range(len(self.rows))))
        for sample in samples:
            self._check(sample)

    def _couplings(self, samples: Sequence[SampledPosition]) -> Couplings:
        """The joints that follow others; rows that say anything else of measured coordinates alone close loops."""
        values = np.array([sample.phi_q for sample in samples])
        try:
            return couplings(self.tree, followed(self.rows, self.pattern, values, self.measured))
        except NoTables:
            if not self.closes_loops:
                raise
        return couplings(self.tree, {})

    def _leave_to_loops(self, rows: Sequence[int]) -> None:
        """Let rows close loops, not links."""
        self.closing = sorted({*self.closing, *rows})
        self.closes = [[r for r in closing_rows if r not in self.closing] for closing_rows in self.closes]

    @property
    def freedoms(self) -> int:
        """Of all joints that follow no others, loops being open."""
        return len(self.screws) - len(self.coupled.leaders)

    # -- positions -----------------------------------------------------------------------------

    def _component(self, component: Component) -> int:
        """A coordinate, or the number of a fixed component behind them."""
        if self.moves(component):
            return self.index[component]
        if not is_number(component.value):
            raise NoTables(f"{component.name} is an expression of parameters")
        return self.n + self.fixed.setdefault(component, len(self.fixed))

    def _components(self, element: Spatial) -> list[int]:
        return [self._component(component) for component in element.components]

    def _reference(self, link: int) -> Point:
        """The point that a link turns about, else one of its own."""
        body, screws = self.tree.links[link].body, self.tree.links[link].screws
        return next((screw.point for screw in screws if screw.point is not None), body.points[0])

    def _terms(self, screw: Screw) -> list[tuple[float, list[int]]]:
        if not all(is_number(weight) for weight, _ in screw.axis.terms):
            raise NoTables("an axis has parameters")
        return [(float(weight), self._components(element)) for weight, element in screw.axis.terms]

    # -- masses --------------------------------------------------------------------------------

    def _take_masses(self, pattern: Pattern, samples: Sequence[SampledPosition]) -> None:
        """Entries of M, each with a link that carries what it speaks of; as a pair where it is the same along all axes."""
        self._weigh(pattern, samples[0])
        masses_between: dict[tuple[int, int, int], dict[tuple[int, int], int]] = defaultdict(dict)
        for (i, j), value in pattern.positions().items():
            if i >= j:
                if i == j and i in self.measured:
                    screw, ratio = self.measured[i]
                    self.rotors.append((screw, value, ratio**2))
                    continue
                if i not in self.where or j not in self.where:
                    raise NoTables("a mass couples coordinates of no body")
                (a, x), (b, y) = sorted((self.where[i], self.where[j]))
                masses_between[self._carrier(a, b), a, b][x, y] = value
        for (link, a, b), entries in sorted(masses_between.items()):
            values = np.array([[sample.mass[value] for value in entries.values()] for sample in samples])
            if all(x == y for x, y in entries) and np.all(np.ptp(values, axis=1) <= 4 * np.finfo(float).eps * np.abs(values[:, 0])):
                self.pairs.append((link, a, b, next(iter(entries.values()))))
            else:
                self.singles += [(link, a, x, b, y, value) for (x, y), value in sorted(entries.items())]

    def _weigh(self, pattern: Pattern, sample: SampledPosition) -> None:
        """How much the velocity of an element counts where the rates of a joint are found, as `ncgen.program.tree.joint_rates` has it:
        of one screw that of the element alone that it moves most, of several those of all, each with its mass."""
        diagonal = scipy.sparse.csr_array((sample.mass, pattern.indices, pattern.indptr), shape=pattern.shape).diagonal()
        masses, size = np.zeros(len(self.elements)), np.ones(len(self.elements))
        for c, (e, _) in self.where.items():
            masses[e], size[e] = max(masses[e], diagonal[c]), self.around.columns[c]
        heaviness, homes = masses * size**2, np.array(self.home)
        for link, rates in enumerate(self.own):
            carried = np.flatnonzero(homes == link)
            heaviest = np.max(heaviness[carried], initial=0.0) or 1.0
            heaviness[carried] = np.maximum(heaviness[carried] / heaviest, MASSLESS_FRACTION) / size[carried] ** 2
            if len(rates) == 1 and len(carried):
                moved = self.velocities(sample.q, np.arange(len(self.screws)) == rates.start)[np.array(self.components)[carried]]
                best = carried[np.argmax(heaviness[carried] * np.sum(moved**2, axis=1))]
                heaviness[carried[carried != best]] = 0.0
        self.heaviness = heaviness.tolist()

    def _carrier(self, a: int, b: int) -> int:
        """A link that two elements move with."""
        deeper, other = (a, b) if self.home[a] >= self.home[b] else (b, a)
        link = self.home[deeper]
        if self.home[other] == link:
            return link
        if self.elements[other] not in self.tree.links[link].body.elements or (self.closes_loops and not self._moves_with(other, link)):
            raise NoTables("a mass belongs to two bodies")
        return link

    def _moves_with(self, element: int, link: int) -> bool:
        """True where an element that belongs to a link before another one is moved by that link's joint as by its own; at the end of a loop
        it is not."""
        is_point = isinstance(self.elements[element], Point)
        for x in self._random():
            values, origins, twists = self._twists(self.around.q, x)
            position = values[self.components[element]]
            (turning, along), velocity = twists[link], self.velocities(self.around.q, x)[self.components[element]]
            carried = cross(turning, position - is_point * origins[link]) + is_point * along
            size = np.max(np.abs(turning)) * np.max(np.abs(position)) + np.max(np.abs(along))
            if np.max(np.abs(velocity - carried)) > RELATIVE_TOLERANCE * size:
                return False
        return True

    # -- rows ----------------------------------------------------------------------------------

    def _take_rows(self) -> None:
        """With which link every row and every coordinate closes."""
        starts, columns = self.pattern.indptr, self.pattern.indices
        self.rows = [columns[starts[r] : starts[r + 1]] for r in range(self.pattern.shape[0])]
        self.group = [self.home[self.where[c][0]] if c in self.where else -1 for c in range(self.n)]
        for row in self.rows:
            deepest = max((self.group[c] for c in row if c in self.where), default=-1)
            for c in row:
                if c not in self.where:
                    self.group[c] = max(self.group[c], deepest)
        if -1 in self.group:
            raise NoTables("a coordinate belongs to no body")
        self.closes: list[list[int]] = [[] for _ in self.tree.links]
        for r, row in enumerate(self.rows):
            if row:
                self.closes[max(self.group[c] for c in row)].append(r)
        self.unknowns: list[list[int]] = [[] for _ in self.tree.links]
        for c, link in enumerate(self.group):
            self.unknowns[link].append(c)

    def _leave_out(self, samples: Sequence[SampledPosition]) -> None:
        """Let no link be closed by rows that vanish in all places; those of Φ_q by links are left."""
        starts, sizes = self.pattern.indptr, self.around.columns[list(self.pattern.indices)]
        entries = np.max([np.abs(sample.phi_q) for sample in samples], axis=0) * sizes
        self.vanishing = {
            r for r, size in enumerate(self.around.rows) if np.max(entries[starts[r] : starts[r + 1]], initial=0.0) <= ENTRY_ROUNDING * size
        }
        self.closes = [[r for r in rows if r not in self.vanishing] for rows in self.closes]

    def _block(self, link: int, phi_q: np.ndarray, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The rows that close a link over its own coordinates, both in natural sizes, and what a step of the others changes in them."""
        rows, column_of = self.closes[link], {c: k for k, c in enumerate(self.unknowns[link])}
        block, others = np.zeros((len(rows), len(column_of))), np.zeros(len(rows))
        for i, r in enumerate(rows):
            begin = self.pattern.indptr[r]
            for k, c in enumerate(self.rows[r]):
                value = phi_q[begin + k] / self.around.rows[r]
                if c in column_of:
                    block[i, column_of[c]] = value * self.around.columns[c]
                else:
                    others[i] += value * step[c]
        return block, others

    def _closed(self, q: np.ndarray, sample_at: Callable[[np.ndarray], SampledPosition]) -> SampledPosition:
        """The closed position near q, each link brought to those before it by the smallest change."""
        for _ in range(MOST_STEPS):
            sample = sample_at(q)
            if np.max(np.abs(np.delete(sample.phi, self.closing)), initial=0.0) <= POSITION_RESIDUAL:
                return sample
            step = np.zeros(self.n)
            for link, unknowns in enumerate(self.unknowns):
                block, others = self._block(link, sample.phi_q, step)
                right = -sample.phi[self.closes[link]] - others
                step[unknowns] = np.linalg.lstsq(block, right, rcond=RELATIVE_TOLERANCE)[0] * self.around.columns[unknowns]
            q = q + step
        raise NoTables("bodies do not close one after the other")

    def _places(self) -> list[SampledPosition]:
        """Closed positions: where the mechanism is, and two around it, with other parameters where there are any."""
        first, *others = self.around.looks
        of_bodies = [r for r, row in enumerate(self.rows) if all(c in self.where for c in row)]
        if self.closes_loops:
            self._leave_to_loops(self._opposed(first(self.around.q), of_bodies))
        closed_places = [self._closed(self.around.q, first)]
        self._check_rows(closed_places[0], of_bodies)
        for k, x in enumerate(self._random()):
            moved = self.velocities(closed_places[0].q, x)[: self.n] * (-1) ** k
            guess = closed_places[0].q + SAMPLE_DISTANCE * moved / np.max(np.abs(moved) / self.around.columns)
            closed_places.append(self._closed(guess, others[k % len(others)] if others else first))
        return closed_places

    def _take_measured(self, samples: Sequence[SampledPosition]) -> None:
        """Which joint every measured coordinate measures: they are those that no body carries."""
        measuring_rows: dict[int, int] = {}
        for r, row in enumerate(self.rows):
            others = [c for c in row if c not in self.where]
            if len(others) == 1:
                measuring_rows.setdefault(others[0], r)
        trials = [(sample, x, self.velocities(sample.q, x)) for sample in samples for x in self._random()]
        for c in (c for c in range(self.n) if c not in self.where):
            if c not in measuring_rows:
                raise NoTables("a coordinate of no body measures no joint")
            rates = np.array([self._rate(c, measuring_rows[c], sample, v) for sample, _, v in trials])
            self.measured[c] = self._measures(self.own[self.group[c]], rates, np.array([x for _, x, _ in trials]))

    def _rate(self, c: int, row: int, sample: SampledPosition, v: np.ndarray) -> float:
        """What a row says of a measured coordinate's rate at the others' velocities."""
        begin = self.pattern.indptr[row]
        entries = {j: sample.phi_q[begin + k] for k, j in enumerate(self.rows[row])}
        return -sum(value * v[j] for j, value in entries.items() if j != c) / entries[c] if entries[c] else np.nan

    def _measures(self, candidates: range, rates: np.ndarray, x: np.ndarray) -> tuple[int, float]:
        """The screw whose rate is that of a measured coordinate in all trials, but for a factor."""
        for k in candidates:
            ratios = rates / x[:, k]
            if np.all(np.isfinite(ratios)) and np.ptp(ratios) <= RELATIVE_TOLERANCE * abs(ratios[0]):
                return k, float(np.round(ratios[0])) if abs(abs(ratios[0]) - 1.0) < RELATIVE_TOLERANCE else float(ratios[0])
        raise NoTables("a measured coordinate is not that of one joint")

    # -- checks --------------------------------------------------------------------------------

    def _random(self) -> np.ndarray:
        """Rates of all joints that have nothing in common, but that some follow others, in natural sizes."""
        sizes = [1.0 if screw.point else np.max(self.around.columns) for screw in self.screws]
        rates = np.random.default_rng(3).uniform(0.5, 1.5, (RANDOM, len(self.screws))) * sizes
        for screw, (leader, ratio) in self.coupled.leaders.items():
            rates[:, screw] = ratio * rates[:, leader]
        return rates

    def velocities(self, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """q̇ (n,) at rates of the joints, those of fixed components behind it: (n + fixed,)."""
        values, origins, twists = self._twists(q, rates)
        qd = np.zeros(len(values))
        turning, along = np.array(twists)[self.home].transpose(1, 0, 2)
        is_point = np.array([isinstance(element, Point) for element in self.elements])[:, None]
        levers = values[self.components] - np.where(is_point, np.array(origins)[self.home], 0.0)
        qd[self.components] = np.cross(turning, levers) + np.where(is_point, along, 0.0)
        for c, (k, ratio) in self.measured.items():
            qd[c] = ratio * rates[k]
        return qd

    def _twists(self, q: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, list[np.ndarray], list[tuple[np.ndarray, np.ndarray]]]:
        """Components, fixed ones behind the coordinates, and of every link where its reference point is, its angular velocity and that
        point's velocity."""
        values = np.append(q, [component.initial for component in self.fixed])
        axes = [sum((weight * values[c] for weight, c in terms), np.zeros(3)) for terms in self.terms]
        origins = [values[c] for c in self.references]
        twists: list[tuple[np.ndarray, np.ndarray]] = []
        for number, link in enumerate(self.tree.links):
            turning, along = np.zeros(3), np.zeros(3)
            if link.parent is not None:
                turning, before = twists[link.parent]
                along = before + cross(turning, origins[number] - origins[link.parent])
            for k in self.own[number]:
                if self.screws[k].point is None:
                    along = along + rates[k] * axes[k]
                else:
                    turning = turning + rates[k] * axes[k]
            twists.append((turning, along))
        return values, origins, twists

    def _check(self, sample: SampledPosition) -> None:
        """Raise NoTables where a row does not allow what the joints do, or lets more move."""
        self._check_rows(sample, range(len(self.rows)))
        if any(rank != freedom for rank, _, freedom in self._ranks(sample)):
            raise NoTables("a body can move otherwise than by its joint")

    def _check_rows(self, sample: SampledPosition, rows: Sequence[int]) -> None:
        """Raise NoTables where one of these rows does not allow what the joints do, unless it closes a loop."""
        if set(self._opposed(sample, rows)) - set(self.closing):
            raise NoTables("rows close loops")

    def _opposed(self, sample: SampledPosition, rows: Sequence[int]) -> list[int]:
        """Those of some rows that do not allow what the joints do. Raises NoTables where joints move a fixed component."""
        opposed: set[int] = set()
        jacobian = scipy.sparse.csr_array((sample.phi_q, self.pattern.indices, self.pattern.indptr), shape=self.pattern.shape)
        for x in self._random():
            v = self.velocities(sample.q, x)
            moved, held, least = v[: self.n], v[self.n :], RELATIVE_TOLERANCE * np.max(np.abs(v[: self.n]))
            off, terms = np.abs(jacobian @ moved), abs(jacobian) @ np.abs(moved)
            rounding = ENTRY_ROUNDING * self.around.rows * np.max(np.abs(moved) / self.around.columns)
            if np.any(np.abs(held) > least):
                raise NoTables("joints move what is fixed")
            opposed |= {r for r in rows if off[r] > RELATIVE_TOLERANCE * terms[r] + rounding[r]}
        return sorted(opposed)

    def is_regular(self, sample: SampledPosition) -> bool:
        """True where all rows are independent, link by link."""
        return not self.vanishing and all(rank == rows == freedom for rank, rows, freedom in self._ranks(sample))

    def _ranks(self, sample: SampledPosition) -> Iterator[tuple[int, int, int]]:
        """Of every link the rank of the rows that close it, how many they are, and what their rank must be."""
        for link, unknowns in enumerate(self.unknowns):
            block, _ = self._block(link, sample.phi_q, np.zeros(self.n))
            largest = np.max(np.abs(block), axis=1, initial=0.0)
            scaled = block / np.where(largest > 0, largest, 1.0)[:, None]
            rank = int(np.linalg.matrix_rank(scaled, tol=RELATIVE_TOLERANCE)) if block.size else 0
            yield rank, len(block), len(unknowns) - sum(k not in self.coupled.leaders for k in self.own[link])
