"""Whether multipliers of a mechanism can be compiled as functions, and what their equations are scaled by."""

from __future__ import annotations

from ncgen.errors import NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.reactive import ReactiveForce
from ncgen.program.motions.full_motion import MotionSizes
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.rank import trial_positions

MOST_UNKNOWNS = 160
"""Coordinates and constraints together up to which multipliers are emitted: so many take 60,000 statements, which compile in 9 s, once a
mechanism."""


def refusal_of_multipliers(kernels: Kernels) -> str:
    """Why multipliers cannot be compiled as functions, in words, or nothing."""
    if any(not isinstance(function, ReactiveForce) for function in kernels.model.callbacks):
        return "the model calls a Python function, whose forces no program has"
    if kernels.n + kernels.m > MOST_UNKNOWNS:
        return f"{kernels.n} coordinates and {kernels.m} constraints are more than {MOST_UNKNOWNS} unknowns, which would compile for long"
    return ""


def motion_sizes(kernels: Kernels) -> MotionSizes:
    """What the matrix of the equations is scaled by, in positions around the model's own start, so that it is the same in every run."""
    try:
        positions = trial_positions(kernels, assemble(kernels, kernels.q0))
    except NcgenError:  # what a mode holds need not be possible near the model's start; sizes are known there as well
        positions = [kernels.q0]
    jacobians, masses = (tuple(f(q) for q in positions) for f in (kernels.jacobian, kernels.mass_matrix))
    return MotionSizes(kernels.column_sizes, jacobians, masses)
