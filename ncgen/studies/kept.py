"""What is kept of every variant: a word a column.

psi2, rate(psi2)   a coordinate, its velocity or an output of the model at the end
max(…), min(…)     the largest and the smallest of them over the run
history(…)         all of them at the study's `times`
energy_drift, steps, time   as of a trajectory, the accepted steps, and the time (s) at the end
first_time(floor), count(floor), impulse(floor), energy_lost(floor)   of an event of the model: when it happens first (s), how often, and
                   the sums of its impulses and of the energy that it takes (J)
gradient(…, mass)  how what stands first, a value at the end or an extreme, changes with a parameter or a `start(…)`;
gradient(…)        with everything that varies, a column each
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ncgen.errors import ModelError
from ncgen.model import Model
from ncgen.model.actions import Locking
from ncgen.model.elements import coordinate_of
from ncgen.solver.argument_checks import Outline, known_name, names_of, offer
from ncgen.solver.trajectories.happening import GAPS, JOINTS, LOCKS, RATCHETS, Happening
from ncgen.studies.design import started
from ncgen.studies.extremes import extremes

OVER = ("max", "min", "history")
GRADIENT = "gradient"
SPECIAL = ("energy_drift", "steps", "time")
OF_EVENTS = ("first_time", "count", "impulse", "energy_lost")

BY_NAME = (*JOINTS, *LOCKS)
"""What counts as the event itself, without its word as well."""


@dataclass(frozen=True)
class Kept:
    """One column. over: "end", an entry of OVER, of SPECIAL or of OF_EVENTS; name: of a coordinate, `rate(…)`, output or event, "" of
    SPECIAL; by: with what it changes, if it is a gradient of that."""

    word: str
    over: str
    name: str = ""
    by: str = ""

    @classmethod
    def of(cls, word: str, known: Outline) -> Kept:
        """Raises ModelError for a word that means nothing."""
        if _is_known(word, known):
            return cls(word, "end", word)
        if word in SPECIAL:
            return cls(word, word)
        over, _, rest = word.partition("(")
        if over in OF_EVENTS and rest.endswith(")"):
            return cls(word, over, known_name(rest.removesuffix(")"), event_names(known.model), f"keep, {word}", "event"))
        name = rest.removesuffix(")") if over in OVER and rest.endswith(")") else word
        if not _is_known(name, known):
            names = (*known.coordinates, *known.model.outputs, *SPECIAL, *(f"{OF_EVENTS[0]}({each})" for each in known.model.events))
            raise ModelError(f"keep: {known.name} has no coordinate or output {name}; {offer(name, names)}")
        return cls(word, over, name)

    @property
    def whole(self) -> bool:
        """Whether the run between its ends counts."""
        return self.over in ("max", "min", "energy_drift")

    @property
    def is_count(self) -> bool:
        """Whether it is a whole number."""
        return self.over in ("steps", "count")

    def of_events(self, happened: Sequence[Happening]) -> float:
        """What is kept of the events of a run. NaN of an event that does not happen has a time."""
        events = [each for each in happened if self.name in (each.label, each.name if each.transition in BY_NAME else "")]
        if self.over == "first_time":
            return events[0].t if events else np.nan
        return float(len(events) if self.over == "count" else sum(getattr(each, self.over) for each in events))

    def is_output(self, model: Model) -> bool:
        return self.name in model.outputs


def kept(words: Sequence[str] | str, known: Outline, varied: Sequence[str] = ()) -> tuple[Kept, ...]:
    """Columns from their words; varied: names of what varies. Raises ModelError for one that means nothing, comes twice, or for none."""
    names = names_of(words, "keep")
    if not names:
        words = f"coordinates, outputs, max(…), min(…), history(…), gradient(…), {', '.join((*SPECIAL, *(f'{w}(…)' for w in OF_EVENTS)))}"
        raise ModelError(f"keep: nothing is kept of {known.name}; name {words}")
    columns = [column for name in names for column in (_gradients(name, known, varied) or [Kept.of(name, known)])]
    if twice := [column.word for k, column in enumerate(columns) if column in columns[:k]]:
        raise ModelError(f"keep: {twice[0]} is named twice")
    return tuple(columns)


def _gradients(word: str, known: Outline, varied: Sequence[str]) -> list[Kept]:
    """Of a word that asks for gradients its columns. Raises ModelError for a number that has none, and for an unknown name."""
    if not (word.startswith(f"{GRADIENT}(") and word.endswith(")")) or _is_known(word, known):
        return []
    of = word[len(GRADIENT) + 1 : -1]
    first, comma, by = (word_part.strip() for word_part in of.rpartition(","))
    whole = not comma or _is_known(of, known)
    column = Kept.of(of if whole else first, known)
    if column.over not in ("end", "max", "min"):
        raise ModelError(f"keep, {word}: a gradient is of a value at the end, or of max(…) or min(…)")
    if not whole:
        _check_source(by, known, f"keep, {word}")
    return [Kept(f"{GRADIENT}({column.word}, {name})", column.over, column.name, name) for name in (varied if whole else (by,))]


def _check_source(name: str, known: Outline, where: str) -> None:
    """Raises ModelError for what is neither a parameter nor the start of a coordinate or velocity."""
    if (inner := started(name)) is None:
        known_name(name, known.parameters, where, "parameter")
    else:
        known_name(coordinate_of(inner), known.coordinates, where)


def _is_known(name: str, known: Outline) -> bool:
    return name in known.model.outputs or coordinate_of(name) in known.index


def event_names(model: Model) -> tuple[str, ...]:
    """What may be named of events: an event, a friction, a ratchet, a lock, and what each does to what is held."""
    contacts = [name for name, event in model.events.items() if event.impact]
    locking = [name for name, event in model.events.items() if any(isinstance(action, Locking) for action in event.do)]
    locks = dict.fromkeys((*model.locks, *locking))
    kinds = ((contacts, GAPS), ((*model.frictions, *model.contacts), JOINTS), (model.ratchets, RATCHETS), (locks, LOCKS))
    held = [f"{name} {transition}" for names, words in kinds for name in names for transition in words]
    return tuple(dict.fromkeys((*model.events, *model.frictions, *model.ratchets, *model.locks, *held)))


@dataclass(frozen=True, eq=False, kw_only=True)
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

    def rates(self, name: str) -> np.ndarray | None:
        """Rates (B, K) of a coordinate; None of what has none."""
        return self.of(f"rate({name})") if name in self.index and name not in self.labels else None

    def column(self, kept: Kept, times: np.ndarray) -> np.ndarray:
        """What is kept, (B,), or (B, times) of a history."""
        values = self.of(kept.name)
        if kept.over == "end":
            return values[:, -1].copy()
        if kept.over == "history":
            return values[:, np.searchsorted(self.t, times)]
        return extremes(self.t, values, self.rates(kept.name))[kept.over == "max"]


def with_events(motion: Histories, happened: Sequence[Happening]) -> Histories:
    """One motion with two more instants at every event, before and after it, so that between instants it is smooth; without outputs."""
    if not happened:
        return motion
    t = np.concatenate([np.repeat([each.t for each in happened], 2), motion.t])
    q = np.vstack([*(each.q[None] for each in happened for _ in range(2)), motion.q[0]])
    qd = np.vstack([*(v[None] for each in happened for v in (each.before, each.after)), motion.qd[0]])
    order = np.argsort(t, kind="stable")  # at one time events stand before a row of the grid, which is behind them
    return Histories(index=motion.index, labels=(), t=t[order], q=q[order][None], qd=qd[order][None], outputs=np.zeros((1, len(t), 0)))
