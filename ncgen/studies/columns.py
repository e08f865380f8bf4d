"""What a study keeps of one motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.solver.trajectories.happening import Happening
from ncgen.studies.definition import Study
from ncgen.studies.kept import OF_EVENTS, Histories, with_events


@dataclass(frozen=True, eq=False, kw_only=True)
class StudiedMotion:
    """t (K,): s; q, qd (K, n); events; steps: accepted ones; outputs: gives those of the model (K, outputs); energy_drift: gives that"""

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    events: tuple[Happening, ...]
    steps: int
    outputs: Callable[[], np.ndarray]
    energy_drift: Callable[[], float]


def columns_of(study: Study, kernels: Kernels, motion: StudiedMotion) -> dict[str, Any]:
    """{column: what is kept of a motion}."""
    outputs = np.zeros((len(motion.t), 0))
    if any(column.is_output(study.model) for column in study.values):
        outputs = motion.outputs()
    histories = Histories(
        index=kernels.index, labels=tuple(kernels.model.outputs), t=motion.t, q=motion.q[None], qd=motion.qd[None], outputs=outputs[None]
    )
    smooth = with_events(histories, motion.events)
    special = {"steps": lambda: motion.steps, "time": lambda: motion.t[-1], "energy_drift": motion.energy_drift}
    kept: dict[str, Any] = {}
    for column in study.values:
        if column.over in special:
            kept[column.word] = special[column.over]()
        elif column.over in OF_EVENTS:
            kept[column.word] = column.of_events(motion.events)
        else:
            is_smooth = column.over in ("max", "min") and not column.is_output(study.model)
            kept[column.word] = (smooth if is_smooth else histories).column(column, study.times)[0]
    return kept
