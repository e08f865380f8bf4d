"""Generalised forces of constraints as compiled functions of a state and of inputs, with their exact derivatives by inputs."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

from ncgen.errors import NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.program_functions import ProgramFunctions, functions
from ncgen.mechanism.reactive import ReactiveForce
from ncgen.program.motions.full_motion import MotionSizes
from ncgen.program.motions.multipliers import STATE, assemble_multipliers
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


def multipliers_of(kernels: Kernels, rows: Sequence[int], by: Sequence[str] = ()) -> ProgramFunctions:
    """The multipliers λ of some constraints: functions `multipliers`, (R,), and `multipliers_by`, (R · B,), of t, q, q̇ and p.

    The generalised force of a constraint along its expression is −λ: N along a gap or a length, N m about an angle. p has the values of
    inputs at t (`Kernels.present`). Only where `refusal_of_multipliers` has no reason against it.

    rows (R): numbers of constraints; by (B): names of parameters or inputs, by which derivatives are wanted; those of an input are exact
    for every size of it, since λ is affine in inputs
    """
    numbers = [kernels.parameters.index(name) for name in by]
    sizes = {"multipliers": len(rows)} | ({"multipliers_by": len(rows) * len(by)} if by else {})
    counts = {"q": kernels.n, "qd": kernels.n, "p": len(kernels.p0)}
    word = f"multipliers_{hashlib.sha256(repr((tuple(rows), numbers)).encode()).hexdigest()[:16]}"
    return kernels.remember(
        "multipliers", (tuple(rows), tuple(by)),
        lambda: functions(
            kernels, word, dict.fromkeys(sizes, STATE), sizes, counts,
            lambda: assemble_multipliers(kernels.programs.equations, motion_sizes(kernels), rows, numbers),
        ),
    )  # fmt: skip


def motion_sizes(kernels: Kernels) -> MotionSizes:
    """What the matrix of the equations is scaled by, in positions around the model's own start, so that it is the same in every run."""
    try:
        positions = trial_positions(kernels, assemble(kernels, kernels.q0))
    except NcgenError:  # what a mode holds need not be possible near the model's start; sizes are known there as well
        positions = [kernels.q0]
    jacobians, masses = (tuple(f(q) for q in positions) for f in (kernels.jacobian, kernels.mass_matrix))
    return MotionSizes(kernels.column_sizes, jacobians, masses)
