"""What is kept of every variant: a word a column.

psi2, rate(psi2)   a coordinate, its velocity or an output of the model at the end
max(…), min(…)     the largest and the smallest of them over the run
history(…)         all of them at the study's `times`
energy_drift, steps, time   as of a trajectory, the accepted steps, and the time (s) at the end
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import Model
from ncgen.model.elements import coordinate_of
from ncgen.solver.given import Outline, names_of, offer
from ncgen.studies.extremes import extremes

OVER = ("max", "min", "history")
SPECIAL = ("energy_drift", "steps", "time")


@dataclass(frozen=True)
class Kept:
    """One column. over: "end", an entry of OVER, or of SPECIAL; name: of a coordinate, `rate(coordinate)` or output, "" of SPECIAL."""

    word: str
    over: str
    name: str = ""

    @classmethod
    def of(cls, word: str, known: Outline) -> Kept:
        """Raises ModelError for a word that means nothing."""
        if _is_known(word, known):
            return cls(word, "end", word)
        if word in SPECIAL:
            return cls(word, word)
        over, _, rest = word.partition("(")
        name = rest.removesuffix(")") if over in OVER and rest.endswith(")") else word
        if not _is_known(name, known):
            names = (*known.coordinates, *known.model.outputs, *SPECIAL)
            raise ModelError(f"keep: {known.name} has no coordinate or output {name}; {offer(name, names)}")
        return cls(word, over, name)

    @property
    def whole(self) -> bool:
        """Whether the run between its ends counts."""
        return self.over in ("max", "min", "energy_drift")

    def is_output(self, model: Model) -> bool:
        return self.name in model.outputs


def kept(words: Sequence[str] | str, known: Outline) -> tuple[Kept, ...]:
    """Columns from their words. Raises ModelError for one that means nothing, comes twice, or for none."""
    names = names_of(words, "keep")
    if not names:
        words = f"coordinates, outputs, max(…), min(…), history(…), {', '.join(SPECIAL)}"
        raise ModelError(f"keep: nothing is kept of {known.name}; name {words}")
    return tuple(Kept.of(name, known) for name in names)


def _is_known(name: str, known: Outline) -> bool:
    return name in known.model.outputs or coordinate_of(name) in known.index


@dataclass(frozen=True, eq=False)
class Histories:
    """Motions of B variants on K instants t (s): q, qd (B, K, n) in m and rad, outputs (B, K, outputs), NaN where a run did not arrive."""

    index: dict[str, int]
    labels: tuple[str, ...]
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    outputs: np.ndarray

    def of(self, name: str) -> np.ndarray:
        """One coordinate, velocity or output, (B, K)."""
        if name in self.labels:
            return self.outputs[..., self.labels.index(name)]
        return (self.q if name in self.index else self.qd)[..., self.index[coordinate_of(name)]]

    def column(self, kept: Kept, times: np.ndarray) -> np.ndarray:
        """What is kept, (B,), or (B, times) of a history."""
        values = self.of(kept.name)
        if kept.over == "end":
            return values[:, -1].copy()
        if kept.over == "history":
            return values[:, np.searchsorted(self.t, times)]
        rates = self.of(f"rate({kept.name})") if kept.name in self.index and kept.name not in self.labels else None
        return extremes(self.t, values, rates)[kept.over == "max"]
