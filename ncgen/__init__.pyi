"""The public names of ncgen, for type checkers and for `ncgen/__init__.py`, which loads a name's module when the name is used."""

from ncgen.compiler import compile as compile
from ncgen.compiler import generate as generate
from ncgen.errors import CompileError as CompileError
from ncgen.errors import ConvergenceError as ConvergenceError
from ncgen.errors import DeadCentreError as DeadCentreError
from ncgen.errors import DomainError as DomainError
from ncgen.errors import Interrupted as Interrupted
from ncgen.errors import ModelError as ModelError
from ncgen.errors import NcgenError as NcgenError
from ncgen.errors import SingularError as SingularError
from ncgen.exchange.examples import load as load
from ncgen.exchange.export import export as export
from ncgen.exchange.jax_functions import jax as jax
from ncgen.exchange.torch_functions import torch as torch
from ncgen.model import Model as Model
from ncgen.model.actions import free as free
from ncgen.model.actions import impact as impact
from ncgen.model.actions import lock as lock
from ncgen.model.curves import smooth_step as smooth_step
from ncgen.report.inspection import inspect as inspect
from ncgen.solver.derivatives.gradients import gradient as gradient
from ncgen.solver.derivatives.sensitivity import hessian as hessian
from ncgen.solver.derivatives.sensitivity import sensitivities as sensitivities
from ncgen.solver.joints.joint_space import joint_space as joint_space
from ncgen.solver.linear.linearise import linearise as linearise
from ncgen.solver.linear.statics import equilibrium as equilibrium
from ncgen.solver.loads.inverse_dynamics import inverse_dynamics as inverse_dynamics
from ncgen.solver.motions.entry_points import accelerations as accelerations
from ncgen.solver.motions.entry_points import simulate as simulate
from ncgen.solver.motions.entry_points import start as start
from ncgen.solver.positions.assembly import assemble as assemble
from ncgen.solver.positions.driven import driven_positions as driven_positions
from ncgen.solver.positions.position import move as move
from ncgen.solver.positions.position import solve_position as solve_position
from ncgen.solver.positions.position import sweep as sweep
from ncgen.solver.positions.rank import freedom as freedom
from ncgen.studies.reading import read as read
from ncgen.studies.running import study as study

__version__: str

def __dir__() -> list[str]: ...
