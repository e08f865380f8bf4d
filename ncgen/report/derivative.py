"""What a mechanism's state derivative costs, emitted in every way that applies."""

from __future__ import annotations

from ncgen.errors import NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.method import Method
from ncgen.program.algebra.elimination import EliminationError
from ncgen.program.ir.cost import cost
from ncgen.program.motions.dynamics import accelerations, assemble_motion, cheapest, closing
from ncgen.solver.engines.acceleration_forms import own_positions, why_matrix
from ncgen.solver.engines.partition_dynamics import samples, split_of
from ncgen.solver.positions.assembly import assemble
from ncgen.solver.positions.partition import choose_partitions


def motion(kernels: Kernels) -> dict | None:
    """One JSON-ready record of what a default run takes: operations of a stage ("derivative") and at the end of a step ("velocities",
    "closing"), and of what is done once ("prepare"). None where it takes accelerations from the factored matrix."""
    positions = own_positions(kernels)
    programs = positions and assemble_motion(kernels.programs.equations, *positions, kernels.column_sizes)
    if not programs:
        return None
    parts = {
        "derivative": programs.derivative,
        "velocities": programs.velocities,
        "positions": programs.closing,
        "prepare": programs.prepare,
    }
    return {name: cost(program).total for name, program in parts.items() if program}


def matrix(kernels: Kernels) -> str | None:
    """Why a default run of a large tree of bodies takes accelerations from the factored matrix; None where it does not."""
    return why_matrix(kernels, Method.of("lagrange", "dop853")) or None


def derivative(kernels: Kernels) -> dict | None:
    """One JSON-ready record: {way: operations of the accelerations}, "chosen", the cheapest way, and "positions", operations of the
    position correction; at the initial position. None where nothing can be emitted, as at a singular one."""
    try:
        q = assemble(kernels)
        split = split_of(choose_partitions(kernels, q, independent=kernels.model.chosen_independent).velocity)
        arguments = kernels.programs.equations, split, samples(kernels, q, kernels.p0), kernels.column_sizes
        ways, closed = accelerations(*arguments), closing(*arguments).program
    except (NcgenError, EliminationError):
        return None
    return {**{name: cost(program).total for name, program in ways.items()}, "chosen": cheapest(ways), "positions": cost(closed).total}
