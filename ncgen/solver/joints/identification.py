"""What identification asks of a joint space: the inertial parameters of its bodies, and which combinations of them forces can tell.

Ten parameters a body, about the origin of its frame and along that frame's axes (a link's frame in its file; elsewhere the body's
first point and the global axes, in the initial position), in Pinocchio's order: m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ncgen.model.singular_values import least_squares
from ncgen.program.initial import assemble_values
from ncgen.program.ir.evaluate import evaluate_rows
from ncgen.program.tree.regressor import ENTRIES, NAMES, RegressorFrame, frames_of
from ncgen.solver.joints.joint_names import refuse_thin

if TYPE_CHECKING:
    from ncgen.solver.joints.joint_dynamics import JointDynamics

DEPENDENT = 1e-8
"""A column of the regressor of which less is left next to those before it, relative to the largest column, is a combination of them."""

STATES = 40
"""Random states, at the least, at which the regressor is looked at."""

VALUES = 16
"""Of a part of a body: mass, centre, tensor row by row, and where the body's first point is initially, with which its frame goes."""


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """The combinations of inertial parameters that forces along the joints depend on.

    names: of all inertial parameters, ten a body; kept: numbers of those that stand for a combination each
    combinations (len(kept), len(names)): base parameters β = combinations · π, and Y π = Y[:, kept] β
    gap: the least of what is left of a column that was kept, over the most of one that was not: the larger, the surer the number
    """

    names: tuple[str, ...]
    kept: tuple[int, ...]
    combinations: np.ndarray
    gap: float

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.kept)

    def text(self, k: int) -> str:
        """The k-th one in words: `hand.mx + 0.3 tool.m`."""
        row = self.combinations[k]
        others = [i for i in np.argsort(-np.abs(row), kind="stable") if row[i] and i != self.kept[k]]
        parts = [self.names[self.kept[k]]]
        for i in others:
            size = "" if abs(abs(row[i]) - 1.0) < DEPENDENT else f"{abs(row[i]):.6g} "
            parts.append(f"{'-' if row[i] < 0 else '+'} {size}{self.names[i]}")
        return " ".join(parts)


def frames(space: JointDynamics) -> list[RegressorFrame]:
    """Of the bodies of the tree. Raises ModelError where a body with inertia is no part of it."""
    refuse_thin(space.kernels, space.tree)
    return frames_of(space.kernels.model, space.tree)


def key_of(frames: list[RegressorFrame]) -> str:
    """A word for these frames, of which programs of the same equations depend."""
    numbers = np.concatenate([np.concatenate([frame.rotation.ravel(), frame.position]) for frame in frames])
    return hashlib.sha256(numbers.tobytes()).hexdigest()[:16]


def names_of(space: JointDynamics) -> tuple[str, ...]:
    """Of all inertial parameters."""
    return tuple(f"{link.body.name}.{name}" for link in space.tree.links for name in NAMES)


def values_of(space: JointDynamics) -> np.ndarray:
    """The inertial parameters π at the parameters of the space (10 · bodies,): kg, kg m, kg m²."""
    model, parameters = space.kernels.model, np.zeros((len(space.tree.links), len(NAMES)))
    inertias = [link.body.inertia for link in space.tree.links]
    parts = [(number, inertia) for number, whole in enumerate(inertias) if whole for inertia in whole.parts or (whole,)]
    bases = [link.body.points[0] for link in space.tree.links]
    values = [x for number, inertia in parts for x in (inertia.mass, *inertia.com, *inertia.tensor.flat, *bases[number].given)]
    program = space.kernels.remember("values of inertias", (), lambda: assemble_values(model, values))
    numbers = evaluate_rows(program, np.append(space.p, 0.0)[None])[0].reshape(len(parts), VALUES)  # also of a model without parameters
    link_frames = frames(space)
    for (number, _), (mass, *rest) in zip(parts, numbers, strict=True):
        rotation, position = link_frames[number].rotation, link_frames[number].position + np.array(rest[12:]) - bases[number].initial
        arm = rotation.T @ (np.array(rest[:3]) - position)
        tensor = rotation.T @ np.reshape(rest[3:12], (3, 3)) @ rotation + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        parameters[number] += [mass, *(mass * arm), *(tensor[i, j] for i, j in ENTRIES)]
    return parameters.ravel()


def base_parameters(space: JointDynamics, tolerance: float = DEPENDENT, seed: int = 1) -> BaseParameters:
    """By a QR decomposition of the regressor at random states, column by column from the first body on.

    tolerance: `DEPENDENT`
    Source: Gautier, Numerical calculation of the base inertial parameters of robots (1991).
    """
    Y = _looked_at(space, seed)
    names, scale = names_of(space), float(np.max(np.linalg.norm(Y, axis=0)))
    kept: list[int] = []
    left = np.zeros(len(names))
    across = np.zeros((len(Y), 0))
    for k, column in enumerate(Y.T):
        rest = column
        for _ in range(2):  # twice is enough for orthogonality (Kahan)
            rest = rest - across @ (across.T @ rest)
        left[k] = np.linalg.norm(rest) / scale
        if left[k] > tolerance:
            kept.append(k)
            across = np.column_stack([across, rest / np.linalg.norm(rest)])
    combinations = least_squares(Y[:, kept], Y)
    combinations[np.abs(combinations) < tolerance] = 0.0
    out = np.delete(left, kept)
    return BaseParameters(names, tuple(kept), combinations, float(np.min(left[kept]) / max(np.max(out, initial=0.0), 1e-300)))


def _looked_at(space: JointDynamics, seed: int) -> np.ndarray:
    """The regressor at random states, one below the other (states · n, parameters)."""
    draw = np.random.default_rng(seed)
    start = space.values(space.kernels.start(space.p))
    states = max(STATES, 20 * len(space.tree.links) // space.n)
    rows = []
    for _ in range(states):
        q = space.placed(start + draw.uniform(-1, 1, space.n))
        rows.append(space.regressor(q, *draw.standard_normal((2, space.n))))
    return np.vstack(rows)
