"""How many variants go together, from what they have cost, and how long the rest will take."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

AIM = 1.0
"""Seconds that a chunk should take: what is lost where a worker dies, and far above what it costs to hand one out."""

FIRST = 64
"""Variants of the first chunks, from which the cost is learnt."""

GROWTH = 8
"""Chunks grow by this factor at most from one to the next."""

MAX_CHUNK_BYTES = 64_000_000
"""Bytes of histories that a chunk may need while it is computed."""


@dataclass(kw_only=True)
class ChunkPace:
    """bytes_each: that a variant needs while it is computed; lanes: variants that should go together, at least."""

    bytes_each: int
    seconds_each: float | None = None
    size: int = FIRST
    done: int = 0
    _clock: float = field(default_factory=time.perf_counter)

    def chunk(self, left: int) -> int:
        """How many variants the next chunk has."""
        return max(1, min(left, self.size, MAX_CHUNK_BYTES // max(self.bytes_each, 1)))

    def learn(self, count: int, seconds: float) -> None:
        """A chunk of so many variants has taken a worker so many seconds."""
        each = seconds / count
        self.seconds_each = each if self.seconds_each is None else 0.5 * (self.seconds_each + each)
        self.size = int(max(1, min(GROWTH * self.size, AIM / max(self.seconds_each, 1e-9))))
        self.done += count

    def left(self, missing: float) -> float | None:
        """Seconds that so many variants will take, at the rate of all so far; None before any is done."""
        return None if not self.done else missing * (time.perf_counter() - self._clock) / self.done
