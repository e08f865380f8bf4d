"""Operations of the compiled code, whose numbers are data, beside those of the sources that people read: `python … MODELS`."""

from __future__ import annotations

import sys
import warnings

import ncgen
from ncgen.exchange.examples import example_names
from ncgen.mechanism import numbered
from ncgen.program.ir.cost import cost
from ncgen.program.motions.dynamics import MotionPrograms, assemble_motion
from ncgen.solver.engines.acceleration_forms import own_positions
from ncgen.symbolic.equations import build_equations


def operations(motion: MotionPrograms | None) -> dict[str, int]:
    """{program: operations} of a motion."""
    programs = (motion.derivative, motion.velocities, motion.closing) if motion else ()
    return {program.name: cost(program).total for program in programs}


def compared(model: ncgen.Model) -> dict[str, tuple[int, int]]:
    """{program: operations with numbers in place, and with numbers as data} of kernels and of the motion."""
    kernels = ncgen.compile(model, "c")
    structure, positions = numbered.of(kernels.programs), own_positions(kernels)
    literal = {name: cost(program).total for name, program in ncgen.generate(model).programs.programs.items()}
    data = {name: cost(program).total for name, program in kernels.programs.programs.items()}
    if structure and positions:
        for record, equations in ((literal, build_equations(model)), (data, structure.terms)):
            record |= operations(assemble_motion(equations, *positions, kernels.column_sizes))
    return {name: (count, data[name]) for name, count in literal.items()}


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    for name in sys.argv[1:] or example_names():
        counts = compared(ncgen.load(name))
        print(f"{name}: " + ", ".join(f"{kernel} {a} {b} ({b / a - 1:+.1%})" for kernel, (a, b) in counts.items() if a != b))
