"""ncgen: multibody systems in natural coordinates, from equations to compiled kernels.

    model = ncgen.load("robot")
    robot = ncgen.compile(model)
    run = ncgen.simulate(robot, 0.5)

Importing ncgen is quick: what a name needs is loaded when the name is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

_HOMES = {
    "Model": "ncgen.model",
    "load": "ncgen.exchange.examples",
    "generate": "ncgen.compiler",
    "compile": "ncgen.compiler",
    "simulate": "ncgen.solver.motions.simulate",
    "start": "ncgen.solver.motions.simulation",
    "smooth_step": "ncgen.model.curves",
    "impact": "ncgen.model.actions",
    "start_batch": "ncgen.solver.motions.simulations",
    "simulate_batch": "ncgen.solver.motions.batch",
    "accelerations_batch": "ncgen.solver.motions.batch",
    "assemble": "ncgen.solver.positions.assembly",
    "freedom": "ncgen.solver.positions.rank",
    "solve_position": "ncgen.solver.positions.position",
    "move": "ncgen.solver.positions.position",
    "sweep": "ncgen.solver.positions.position",
    "driven_positions": "ncgen.solver.positions.driven",
    "inverse_dynamics": "ncgen.solver.loads.inverse_dynamics",
    "sensitivities": "ncgen.solver.derivatives.sensitivity",
    "gradient": "ncgen.solver.derivatives.sensitivity",
    "gradient_batch": "ncgen.solver.derivatives.gradients",
    "hessian": "ncgen.solver.derivatives.sensitivity",
    "equilibrium": "ncgen.solver.linear.statics",
    "linearise": "ncgen.solver.linear.linearise",
    "joint_space": "ncgen.solver.joints.joint_space",
    "inspect": "ncgen.report.inspection",
    "export": "ncgen.exchange.export",
    "jax": "ncgen.exchange.jax_functions",
    "torch": "ncgen.exchange.torch_functions",
    "study": "ncgen.studies.running",
    "read": "ncgen.studies.reading",
    "NcgenError": "ncgen.errors",
    "ModelError": "ncgen.errors",
    "DomainError": "ncgen.errors",
    "CompileError": "ncgen.errors",
    "ConvergenceError": "ncgen.errors",
    "DeadCentreError": "ncgen.errors",
    "SingularError": "ncgen.errors",
    "Interrupted": "ncgen.errors",
}

# The same names for editors and type checkers, which do not run this file; a test compares all three lists.
__all__ = [
    "CompileError",
    "ConvergenceError",
    "DeadCentreError",
    "DomainError",
    "Interrupted",
    "Model",
    "ModelError",
    "NcgenError",
    "SingularError",
    "accelerations_batch",
    "assemble",
    "compile",
    "driven_positions",
    "equilibrium",
    "export",
    "freedom",
    "generate",
    "gradient",
    "gradient_batch",
    "hessian",
    "impact",
    "inspect",
    "inverse_dynamics",
    "jax",
    "joint_space",
    "linearise",
    "load",
    "move",
    "read",
    "sensitivities",
    "simulate",
    "simulate_batch",
    "smooth_step",
    "solve_position",
    "start",
    "start_batch",
    "study",
    "sweep",
    "torch",
]

if TYPE_CHECKING:
    from ncgen.compiler import compile, generate
    from ncgen.errors import (
        CompileError,
        ConvergenceError,
        DeadCentreError,
        DomainError,
        Interrupted,
        ModelError,
        NcgenError,
        SingularError,
    )
    from ncgen.exchange.examples import load
    from ncgen.exchange.export import export
    from ncgen.exchange.jax_functions import jax
    from ncgen.exchange.torch_functions import torch
    from ncgen.model import Model
    from ncgen.model.actions import impact
    from ncgen.model.curves import smooth_step
    from ncgen.report.inspection import inspect
    from ncgen.solver.derivatives.gradients import gradient_batch
    from ncgen.solver.derivatives.sensitivity import gradient, hessian, sensitivities
    from ncgen.solver.joints.joint_space import joint_space
    from ncgen.solver.linear.linearise import linearise
    from ncgen.solver.linear.statics import equilibrium
    from ncgen.solver.loads.inverse_dynamics import inverse_dynamics
    from ncgen.solver.motions.batch import accelerations_batch, simulate_batch
    from ncgen.solver.motions.simulate import simulate
    from ncgen.solver.motions.simulation import start
    from ncgen.solver.motions.simulations import start_batch
    from ncgen.solver.positions.assembly import assemble
    from ncgen.solver.positions.driven import driven_positions
    from ncgen.solver.positions.position import move, solve_position, sweep
    from ncgen.solver.positions.rank import freedom
    from ncgen.studies.reading import read
    from ncgen.studies.running import study
else:  # type checkers would take this for a promise of any name at all

    def __getattr__(name: str) -> object:
        if name not in _HOMES:
            raise AttributeError(f"module 'ncgen' has no attribute {name!r}")
        return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
