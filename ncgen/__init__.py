"""ncgen: multibody systems in natural coordinates, from equations to compiled kernels.

    model = ncgen.load("robot")
    robot = ncgen.compile(model)
    run = ncgen.simulate(robot, 0.5)

Importing ncgen is quick: what a name needs is loaded when the name is used.
"""

from __future__ import annotations

from importlib import import_module

__version__ = "0.1.0"

_HOMES = {
    "Model": "ncgen.model",
    "load": "ncgen.exchange.examples",
    "generate": "ncgen.compiler",
    "compile": "ncgen.compiler",
    "simulate": "ncgen.solver.simulate",
    "simulate_batch": "ncgen.solver.batch",
    "accelerations_batch": "ncgen.solver.batch",
    "assemble": "ncgen.solver.assembly",
    "freedom": "ncgen.solver.rank",
    "solve_position": "ncgen.solver.position",
    "move": "ncgen.solver.position",
    "sweep": "ncgen.solver.position",
    "inverse_dynamics": "ncgen.solver.inverse_dynamics",
    "sensitivities": "ncgen.solver.sensitivity",
    "gradient": "ncgen.solver.sensitivity",
    "equilibrium": "ncgen.solver.statics",
    "linearise": "ncgen.solver.linearise",
    "inspect": "ncgen.report.inspection",
    "NcgenError": "ncgen.errors",
    "ModelError": "ncgen.errors",
    "DomainError": "ncgen.errors",
    "CompileError": "ncgen.errors",
    "ConvergenceError": "ncgen.errors",
    "SingularError": "ncgen.errors",
    "Interrupted": "ncgen.errors",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str):
    if name not in _HOMES:
        raise AttributeError(f"module 'ncgen' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__():
    return __all__
