"""What a mechanism's state derivative costs, written out in every way that applies."""

from __future__ import annotations

from ncgen.errors import NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.program.cost import cost
from ncgen.program.dynamics import accelerations, cheapest, closing
from ncgen.program.elimination import EliminationError
from ncgen.solver.assembly import assemble
from ncgen.solver.compiled import samples, split_of
from ncgen.solver.partition import choose_partitions


def derivative(kernels: Kernels) -> dict | None:
    """One JSON-ready record: {way: operations of the accelerations}, "taken", the cheapest way, and "closing", operations of what closes
    positions; at the initial position. None where nothing can be written out, as at a singular one."""
    try:
        q = assemble(kernels)
        split = split_of(choose_partitions(kernels, q, independent=kernels.model.chosen_independent).velocity)
        given = kernels.programs.equations, split, samples(kernels, q, kernels.p0), kernels.column_sizes
        ways, closed = accelerations(*given), closing(*given)
    except (NcgenError, EliminationError):
        return None
    return {**{name: cost(program).total for name, program in ways.items()}, "taken": cheapest(ways), "closing": cost(closed).total}
