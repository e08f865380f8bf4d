"""When a motion on independent coordinates looks for others: where these have become bad, and not again where all are as bad."""

from __future__ import annotations

from ncgen.solver.positions.partition import Partitions, PartitionsAt

DEGRADED = 0.7
"""Other independent coordinates are looked for when the quality falls below this fraction of what it is compared with: late changes cost
more in short steps than early ones in restarts."""


class PartitionWatch:
    """Compares the quality of the partitions of a motion with what it was when they were chosen. Where a search finds nothing better, the
    quality is compared with the best one there, until the present partitions are better again.
    """

    def __init__(self, here: PartitionsAt, present: Partitions) -> None:
        self._chosen_with = self._compared_with = here.worth(present)

    def better(self, here: PartitionsAt, present: Partitions) -> Partitions | None:
        """Clearly better partitions; None where the present ones are not bad, or there are no better ones."""
        quality = here.worth(present)
        self._compared_with = min(self._chosen_with, max(self._compared_with, quality))
        return self.search(here, present) if quality <= DEGRADED * self._compared_with else None

    def search(self, here: PartitionsAt, present: Partitions) -> Partitions | None:
        """Clearly better partitions, from which on these are watched; None where there are none."""
        better, self._compared_with = here.better(present)
        if better is not None:
            self._chosen_with = self._compared_with
        return better
