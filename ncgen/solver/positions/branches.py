"""The paper's sine-or-cosine rule as explicit state.

Rows of `form="paper"` take their choice from run-time parameters. It is refreshed between Newton solves
and frozen inside them, so it is part of p: copyable, and nobody's hidden memory.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ncgen.errors import ConvergenceError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.coordinates import paper_choice
from ncgen.model.elements import Angle
from ncgen.solver.geometry import direction, element

DISAGREE = 1e-6
"""Relative residual from which sine and cosine of one angle contradict each other."""


def refresh_branches(kernels: Kernels, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Parameters p with every paper row's choice made anew at q; p itself where there are none."""
    return _choose(kernels, q, p, lambda name: float(element(kernels, name, q, p)[0]))


def rule_of(kernels: Kernels) -> Callable[[np.ndarray, np.ndarray], np.ndarray] | None:
    """`refresh_branches` of q and p, None where no row has a choice."""
    return partial(refresh_branches, kernels) if kernels.model.branches else None


def one_kind(kernels: Kernels, q: np.ndarray, p: np.ndarray, kind: str) -> np.ndarray:
    """Parameters with every paper row set to its cosine ("cosine") or largest sine component ("sine"), for lessons."""
    as_if = {"cosine": np.pi / 2, "sine": 0.0}[kind]
    return _choose(kernels, q, p, lambda name: as_if)


def check_choices(kernels: Kernels, q: np.ndarray, t: float, p: np.ndarray) -> None:
    """Raise ConvergenceError naming a paper angle for which sine and cosine say different things at a closed position q: a run would
    jump where the choice changes. They agree where both elements are perpendicular to the axis."""
    for kind in ("cosine", "sine") if kernels.model.branches else ():
        open_by = np.abs(kernels.phi(q, t, one_kind(kernels, q, p, kind))) / kernels.row_sizes
        if np.max(open_by) > DISAGREE:
            row = kernels.rows[int(np.argmax(open_by))]
            raise ConvergenceError(
                f"{kernels.name}: {row.label}: its sine and its cosine contradict each other by {np.max(open_by):.2g}, since an element "
                "is not perpendicular to the axis; take form='smooth'"
            )


def _choose(kernels: Kernels, q: np.ndarray, p: np.ndarray, angle: Callable[[str], float]) -> np.ndarray:
    branches = kernels.model.branches
    if not branches:
        return p
    p = np.array(p, dtype=float)
    position = {name: i for i, name in enumerate(kernels.parameters)}
    for name, weights in branches.items():
        coordinate = kernels.model.elements[name]
        if isinstance(coordinate, Angle):  # nothing else has a choice
            chosen = paper_choice(angle(name), direction(kernels, coordinate.axis, q, p))
            for k, weight in enumerate(weights):
                p[position[weight.name]] = float(k == chosen)
    return p
