"""Operations of accelerations and of conditions with nothing held, in modes, and in the mechanism with switches.

python tests/benchmarks/held.py
"""

from __future__ import annotations

from collections.abc import Iterator

import ncgen
from ncgen.exchange.examples import example_module
from ncgen.mechanism.kernels import Kernels
from ncgen.program.ir.cost import cost
from ncgen.program.motions.dynamics import assemble_motion
from ncgen.program.motions.event_programs import assemble_mode_conditions
from ncgen.solver.engines.acceleration_forms import own_positions
from ncgen.solver.events.conditions import EventFunctions
from ncgen.solver.events.event_table import EventTable
from ncgen.solver.events.held_mechanism import with_switches
from ncgen.solver.events.modes import held_loads, variant
from ncgen.solver.loads.constraint_loads import motion_sizes

CASES = {
    "winch": ("winch.py", "winch", ["brake ratchet", "brake clutch"]),
    "rocking block": ("winch.py", "rocking", ["A", "B"]),
    "screw": ("impacts.py", "screw", ["thread.friction"]),
}
"""{mechanism: file and function of an example, and what its modes hold}"""


def accelerations(kernels: Kernels) -> int:
    """Operations of accelerations by the emitted recursion."""
    motion = assemble_motion(kernels.programs.equations, *own_positions(kernels), kernels.column_sizes)
    return cost(motion.derivative).total


def counts(file: str, function: str, modes: list[str]) -> Iterator[tuple[str, int | None, int]]:
    """What is held, operations of accelerations (None by the matrix, with switches) and of the conditions with those of loads."""
    made = getattr(example_module("", file), function)()
    model = made[0] if isinstance(made, tuple) else made
    kernels = ncgen.compile(model)
    functions = EventFunctions(kernels)
    rows = [*functions.locks.values(), *functions.rows]
    for names in ["", *modes]:
        held = tuple(row for row in rows if row.name in names.split())
        mode = variant(kernels, held)
        loads = held_loads(mode, tuple(row for row in held if row.number >= 0))
        conditions = assemble_mode_conditions(mode.programs.equations, functions.conditions, loads, (), motion_sizes(mode), mode.row_sizes)
        yield names, accelerations(mode), cost(conditions["conditions"]).total
    switched = ncgen.compile(with_switches(model))
    yield "with switches", None, cost(EventTable(switched, switched.programs.equations).held.programs[0]).total


if __name__ == "__main__":
    for mechanism, case in CASES.items():
        for names, operations, conditions in counts(*case):
            print(f"{mechanism:15} {names or 'nothing':16} {'matrix' if operations is None else operations:>7} {conditions:>5}")
