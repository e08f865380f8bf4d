"""A tree of bodies as tables, from which the runtime moves it in loops (`ncgen_tree` in ncgen_runtime.h).

Nothing is emitted for a mechanism, so a tree of a thousand joints compiles nothing, and its motion costs the same for every joint. Tables
are checked on numbers: every row allows what the joints do or closes a loop, nothing else moves, and measured coordinates grow with their
joints.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy

from ncgen.model.singular_values import least_squares, pseudoinverse
from ncgen.model.values import Parameter
from ncgen.program.ir.blocks import Pattern
from ncgen.program.tree.couplings import RELATIVE_TOLERANCE, Couplings, NoTables, couplings, followed
from ncgen.program.tree.tree_homes import with_homes
from ncgen.program.tree.tree_masses import heaviness_of, masses_of
from ncgen.program.tree.tree_rows import ENTRY_ROUNDING, RANDOM, Around, SampledPosition, TreeRows, ranks_of
from ncgen.symbolic.numbering import Numbering
from ncgen.symbolic.tree import Tree

POSITION_RESIDUAL = 1e-12
"""The relative residual of a closed position."""

MOST_STEPS = 30
"""Newton steps that close one."""

LARGEST_RESIDUAL = 10.0
"""The residual, in natural sizes, from which none closes."""

LOOP_TOLERANCE = 1e-7
"""As RELATIVE_TOLERANCE, of rows between closed loops: their positions are known to POSITION_RESIDUAL, their rows to that over an angle."""

SAMPLE_DISTANCES = 0.05, 0.01, 0.002
"""How far the other positions are, in natural sizes: the first from which loops close."""


class OpenTree(TreeRows):
    """A tree of bodies whose joints are all that moves, seen in numbers.

    patterns: of M and Φ_q; closes_loops: whether rows may close loops; opposed: all that do, of which `closing` imply the others
    aside: a closed position that is not the mechanism's own, at other parameters where there are some
    Raises NoTables for any other mechanism.
    """

    def __init__(
        self,
        numbering: Numbering,
        tree: Tree,
        patterns: tuple[Pattern, Pattern],
        around: Around,
        parameters: dict[str, Parameter],
        closes_loops: bool = False,
    ) -> None:
        mass, phi_q = patterns
        if closes_loops:
            tree = with_homes(numbering, tree, around.q, float(np.max(around.columns)))
        super().__init__(numbering, tree, phi_q, around)
        self.closes_loops = closes_loops
        self.leading: list[int] = []
        samples = self._places()
        self.aside = samples[-1]
        self._leave_out(samples)
        together = self.moving_together(samples[0].q, self._random())
        self.masses = masses_of(self, mass, np.array([sample.mass for sample in samples]), parameters, together)
        self.heaviness = heaviness_of(self, mass, samples[0].mass, samples[0].q, around.columns)
        for sample in samples:
            self._check(sample)
        self._check_shown(samples[0].q)
        self.opposed = self.closing
        self.closing = self._independent(samples)

    def _couplings(self, q: np.ndarray) -> Couplings:
        """The joints that follow others, in any positions; rows that say anything else of measured coordinates alone close loops."""
        aside = SAMPLE_DISTANCES[0] * self.around.columns * np.random.default_rng(5).uniform(-1, 1, (RANDOM, self.n))
        values = np.array([look(q + step).phi_q for look in self.around.looks for step in (0.0, *aside)])
        try:
            return couplings(self.tree, followed(self.rows, self.pattern, values, self.measured))
        except NoTables:
            if not self.closes_loops:
                raise
        return couplings(self.tree, {})

    # -- positions -----------------------------------------------------------------------------

    def _places(self) -> list[SampledPosition]:
        """Closed positions: where the mechanism is, and two around it, with other parameters where there are any."""
        first, *others = self.around.looks
        of_bodies = [r for r, row in enumerate(self.rows) if all(c in self.where for c in row)]
        if self.closes_loops:
            self._leave_to_loops(self._opposed(first(self.around.q), of_bodies))
        start = self._closed(self.around.q, first)
        self._check_rows(start, of_bodies)
        if self.closing:
            self._take_copies(start)
        self._take_measured(start)
        self.coupled = self._couplings(start.q)
        if self.closes_loops:
            self._leave_to_loops(self._opposed(start, range(len(self.rows))))
            self.leading = self._independent([start])
        closed_places = [self._closed_loops([start.q], first) or start]
        for k, x in enumerate(self._allowed(start)):
            moved = self.velocities(start.q, x)[: self.n] * (-1) ** k
            size = np.max(np.abs(moved) / self.around.columns)
            if not size > 0:
                raise NoTables("its joints leave no motion")
            aside = moved / size
            guesses = [start.q + distance * aside for distance in SAMPLE_DISTANCES]
            look = others[k % len(others)] if others else first
            closed_places.append(self._closed_loops(guesses, look) or self._closed(guesses[0], look))
        return closed_places

    def _closed(self, q: np.ndarray, sample_at: Callable[[np.ndarray], SampledPosition], with_loops: bool = False) -> SampledPosition:
        """The closed position near q, each link brought to those before it by the smallest change, and loops closed by the joints."""
        across = self._across_loops()
        for _ in range(MOST_STEPS):
            sample = sample_at(q)
            if not np.max(np.abs(sample.phi), initial=0.0) <= LARGEST_RESIDUAL:
                break
            if np.max(np.abs(sample.phi if with_loops else np.delete(sample.phi, across)), initial=0.0) <= POSITION_RESIDUAL:
                return sample
            q = q + self._step_of_links(sample, with_loops)
            if with_loops:
                sample = sample_at(q)
                if not np.max(np.abs(sample.phi), initial=0.0) <= LARGEST_RESIDUAL:
                    break
                joints = least_squares(self._over_joints(sample, self.leading), -sample.phi[self.leading], RELATIVE_TOLERANCE)
                q = q + self.velocities(q, self._rates(joints))[: self.n]
        raise NoTables("bodies do not close one after the other")

    def _closed_loops(self, guesses: Sequence[np.ndarray], sample_at: Callable[[np.ndarray], SampledPosition]) -> SampledPosition | None:
        """The position near the first of some guesses from which links and loops close."""
        for guess in guesses if self.closing else ():
            try:
                return self._closed(guess, sample_at, with_loops=True)
            except NoTables:
                pass
        return None

    def _across_loops(self) -> list[int]:
        """Rows that hold where loops are closed alone."""
        return sorted({*self.closing}.union(*self.copied_rows))

    def _leave_out(self, samples: Sequence[SampledPosition]) -> None:
        """Let no link be closed by rows that vanish in all places; those of Φ_q by links are left."""
        starts, sizes = self.pattern.indptr, self.around.columns[list(self.pattern.indices)]
        entries = np.max([np.abs(sample.phi_q) for sample in samples], axis=0) * sizes
        self.vanishing = {
            r for r, size in enumerate(self.around.rows) if np.max(entries[starts[r] : starts[r + 1]], initial=0.0) <= ENTRY_ROUNDING * size
        }
        self._lay_out()

    # -- measured coordinates ------------------------------------------------------------------

    def _take_measured(self, sample: SampledPosition) -> None:
        """Which joint every measured coordinate measures: they are those that no body carries."""
        measuring_rows: dict[int, int] = {}
        for r, row in enumerate(self.rows):
            others = [c for c in row if c not in self.where]
            if len(others) == 1:
                measuring_rows.setdefault(others[0], r)
        rates = self._random()
        moved = self._moved(sample.q, rates)
        for c in (c for c in range(self.n) if c not in self.where):
            if c not in measuring_rows:
                raise NoTables("a coordinate of no body measures no joint")
            self._find_measured(c, measuring_rows[c], sample, rates, moved)
        self._lay_out()

    def _find_measured(self, c: int, r: int, sample: SampledPosition, rates: np.ndarray, moved: np.ndarray) -> None:
        """The joint that a coordinate measures by a row: that of the link that closes it, or of one with copies."""
        row = self.rows[r]
        with_copies = [(link, slots) for link in range(len(self.tree.links)) if (slots := self._slots(link, row))] if self.copies else []
        for link, slots in [(self.group[c], row), *with_copies]:
            entries = sample.phi_q[self.pattern.indptr[r] : self.pattern.indptr[r + 1]]
            others = np.array([j != c for j in row])
            if not np.all(entries[~others]):
                continue
            speeds = -(moved[:, list(slots)][:, others] @ entries[others]) / entries[~others]
            for k in self.own[link]:
                ratios = speeds / rates[:, k]
                if np.all(np.isfinite(ratios)) and np.ptp(ratios) <= RELATIVE_TOLERANCE * abs(ratios[0]):
                    exact = float(np.round(ratios[0])) if abs(abs(ratios[0]) - 1.0) < RELATIVE_TOLERANCE else float(ratios[0])
                    self.group[c], self.measured[c] = link, (k, exact)
                    if slots is not row:
                        self.copied_rows[link][r] = slots
                    return
        raise NoTables("a measured coordinate is not that of one joint")

    # -- loops ---------------------------------------------------------------------------------

    def _leave_to_loops(self, rows: Sequence[int]) -> None:
        """Let rows close loops, not links but by copies."""
        self.closing = sorted({*self.closing, *rows})
        self._lay_out()

    def _over_joints(self, sample: SampledPosition, rows: Sequence[int]) -> np.ndarray:
        """Φ_q of rows over the rates of joints: (rows, free)."""
        moved = self.velocities(sample.q, self._rates(np.eye(self.freedoms)))[:, : self.n]
        return np.array([self.pattern.times(sample.phi_q, v)[rows] for v in moved]).T / self.around.rows[rows, None]

    def _allowed(self, sample: SampledPosition) -> np.ndarray:
        """Random rates (tries, screws) of all joints that loops allow."""
        if not self.closing:
            return self._random()
        jacobian = self._over_joints(sample, self.closing)
        free = np.random.default_rng(4).uniform(0.5, 1.5, (RANDOM, self.freedoms))
        return self._rates(free - free @ pseudoinverse(jacobian, RELATIVE_TOLERANCE) @ jacobian)

    def _has_closed_loops(self, sample: SampledPosition) -> bool:
        return bool(np.max(np.abs(sample.phi[self.closing]), initial=0.0) <= POSITION_RESIDUAL)

    def _independent(self, samples: Sequence[SampledPosition]) -> list[int]:
        """Rows that close loops and imply the others that do, wherever loops are closed."""
        closed = [sample for sample in samples if self._has_closed_loops(sample)]
        if not self.closing or not closed:
            return self.closing
        jacobians = [self._over_joints(sample, self.closing) for sample in closed]
        scaled = jacobians[-1] / np.max(np.abs(jacobians[-1]), axis=1, keepdims=True)
        _, triangle, order = scipy.linalg.qr(scaled.T, mode="economic", pivoting=True)
        diagonal = np.abs(np.diag(triangle))
        chosen = sorted(order[: np.sum(diagonal > LOOP_TOLERANCE * diagonal[0])])
        for jacobian in jacobians:
            rest = jacobian - jacobian @ pseudoinverse(jacobian[chosen], RELATIVE_TOLERANCE) @ jacobian[chosen]
            if np.max(np.abs(rest)) > LOOP_TOLERANCE * np.max(np.abs(jacobian)):
                return self.closing
        return [self.closing[k] for k in chosen]

    # -- checks --------------------------------------------------------------------------------

    def _check(self, sample: SampledPosition) -> None:
        """Raise NoTables where a row does not allow what the joints do, or lets more move."""
        self._check_rows(sample, range(len(self.rows)))
        is_closed = self._has_closed_loops(sample)
        for link, (rank, _, freedom) in enumerate(self.ranks(sample)):
            if rank != freedom and (is_closed or not self.copied_rows[link]):
                raise NoTables(f"{self.tree.links[link].body} can move otherwise than by its joint")

    def _check_shown(self, q: np.ndarray) -> None:
        """Raise NoTables where a joint's motion moves nothing that stands with its link."""
        rates, freedoms = self._rates_of_links()
        moved = self.velocities(q, rates, alone=True)[:, : self.n] / self.around.columns
        blocks = [moved[:free, [c for c in each if c < self.n]] for free, each in zip(freedoms, self.unknowns, strict=True)]
        for link, (rank, free) in enumerate(zip(ranks_of(blocks), freedoms, strict=True)):
            if rank < free:
                raise NoTables(f"what shows how {self.tree.links[link].body} moves stands with bodies at the other end of a loop")

    def _check_rows(self, sample: SampledPosition, rows: Sequence[int]) -> None:
        """Raise NoTables where one of these rows does not allow what the joints do, unless it closes a loop."""
        if set(self._opposed(sample, rows)).difference(self.closing):
            raise NoTables("rows close loops")
