"""The frequency response of a linearised mechanism as a Bode plot."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ncgen.solver.linear.linearise import Linearisation
from ncgen.view.chart import GRID, empty, finished

FREQUENCY_MARGIN = 10.0
"""How far frequencies go below the slowest pole and above the fastest, where none are given."""

POINTS = 400


def response(near: Linearisation, w: ArrayLike | None = None) -> Figure:
    """Gain and phase of every output by every input over the frequency (Hz): a column an input, a line an output.

    w: angular frequencies (rad/s); without them a range about the poles. Raises ModelError as `Linearisation.frequency_response`.
    """
    w = _about(near) if w is None else np.asarray(w, dtype=float)
    gains = near.frequency_response(w)
    chart = empty(1.0 + 4.5 * len(near.inputs), 5.0)
    panels = chart.subplots(2, len(near.inputs), sharex=True, squeeze=False)
    for j, input in enumerate(near.inputs):
        gain, phase = panels[:, j]
        for i, output in enumerate(near.outputs):
            gain.plot(w / (2 * np.pi), np.abs(gains[:, i, j]), label=output, linewidth=1.5)
            phase.plot(w / (2 * np.pi), np.degrees(np.unwrap(np.angle(gains[:, i, j]))), linewidth=1.5)
        gain.set_title(f"by {input}")
        gain.set_xscale("log")
        gain.set_yscale("log")
        gain.set_ylabel("gain")
        phase.set_ylabel("phase (°)")
        phase.set_xlabel("frequency (Hz)")
        for axes in (gain, phase):
            axes.grid(**GRID)
            axes.margins(x=0)
    panels[0, -1].legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, frameon=False, fontsize=9)
    return finished(chart)


def _about(near: Linearisation) -> np.ndarray:
    """Frequencies (rad/s) from below the slowest pole to above the fastest; about 1 rad/s where all are 0."""
    sizes = np.array([abs(pole.value) for pole in near.poles])
    sizes = sizes[sizes > 1e-6 * np.max(sizes, initial=0.0)] if np.any(sizes > 0) else np.ones(1)
    return np.geomspace(np.min(sizes) / FREQUENCY_MARGIN, np.max(sizes) * FREQUENCY_MARGIN, POINTS)
