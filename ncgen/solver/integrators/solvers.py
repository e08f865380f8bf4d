"""Integrators in Python: SciPy's step-by-step solvers, and others that have the same face."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Protocol, cast

import numpy as np
import scipy.integrate
from scipy.integrate import DenseOutput, OdeSolver

from ncgen.mechanism.kernels import Kernels
from ncgen.methods.table import Integrator
from ncgen.solver.integrators.caught import Asked, ForeignSolver
from ncgen.solver.integrators.fixed_step import FixedRungeKutta
from ncgen.solver.integrators.ode import Slope
from ncgen.solver.integrators.sundials import CvodeAdams, CvodeBdf


class _WithSlope(Protocol):
    """A solver that keeps the derivative of the present state."""

    f: np.ndarray


class Adams(ForeignSolver):
    """Variable-order Adams (VODE) as a SciPy step-by-step solver: the paper's ode113."""

    def _begun(self, jac: Slope | None, **options: float | np.ndarray) -> scipy.integrate.ode:
        engine = scipy.integrate.ode(self._slope).set_integrator("vode", method="adams", nsteps=100000, **options)
        return engine.set_initial_value(self.y, self.t)

    def _slope(self, t: float, y: np.ndarray) -> np.ndarray:
        return np.broadcast_to(self._caught.call(self.fun, t, y), y.shape)

    def _step_impl(self) -> tuple[bool, str | None]:
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            try:
                self._engine.integrate(self.t_bound, step=True)
            except UserWarning as problem:
                self._caught.raise_caught()
                return False, str(problem)
        self._caught.raise_caught()
        self.t, self.y = self._engine.t, self._engine.y.copy()
        if self.direction * (self.t - self.t_bound) > 0:
            # VODE steps past the end; come back by its own interpolation.
            self.y = self._engine.integrate(self.t_bound).copy()
            self.t = self.t_bound
        return True, None

    def _dense_output_impl(self) -> DenseOutput:
        return Asked(self, self._engine.integrate)


class Pace:
    """Steps with error control that come no farther, as near a singular position or where a rate becomes infinite.

    span: of the run (s)
    At the pace of STEPS that come no farther than SHARE of it a run takes a billion steps, as many as fixed steps may be.
    """

    STEPS, SHARE = 400, 4e-7

    def __init__(self, start: float, span: float) -> None:
        self.mark, self.least, self.steps = start, self.SHARE * span, 0

    def creeps(self, t: float) -> bool:
        """Called once a step: whether so many steps have come no farther than that share of the run."""
        self.steps += 1
        if self.steps % self.STEPS:
            return False
        before, self.mark = self.mark, t
        return t - before < self.least


def replace_state(solver: scipy.integrate.OdeSolver, y: np.ndarray) -> None:
    """Put a slightly corrected state in place of an accepted one; the method continues from it with its history as it is.

    The correction is of the size of the tolerance, as are the errors in the history (Eich 1993, doi 10.1137/0730073).
    """
    solver.y = y
    if isinstance(solver, scipy.integrate.BDF):
        solver.D[0] = y
    elif isinstance(solver, (Adams, scipy.integrate.LSODA)):
        engine = solver._engine if isinstance(solver, Adams) else solver._lsoda_solver
        # ODEPACK's solvers keep their state in the first column of Nordsieck's array, behind 20 numbers of their own.
        engine._y = y.copy()
        engine._integrator.rwork[20 : 20 + solver.n] = y
    else:
        cast("_WithSlope", solver).f = solver.fun(solver.t, y)  # all others keep it, which their common class does not say


ODE_SOLVERS: dict[str, type[OdeSolver]] = {
    "rk23": scipy.integrate.RK23,
    "dopri5": scipy.integrate.RK45,
    "dop853": scipy.integrate.DOP853,
    "adams": Adams,
    "bdf": scipy.integrate.BDF,
    "radau": scipy.integrate.Radau,
    "lsoda": scipy.integrate.LSODA,
    "cvode-adams": CvodeAdams,
    "cvode-bdf": CvodeBdf,
}
"""SciPy's step-by-step solvers and others with their face, by the names of `ncgen.methods.table`. Where SciPy has an explicit method,
it is SciPy's and not the one of our tableaus: so it can judge the C runtime."""


@cache
def ode_solver(integrator: Integrator) -> type[OdeSolver]:
    """The step-by-step solver of an integrator that takes a state derivative, one that is `in_python`."""
    if integrator.name in ODE_SOLVERS:
        return ODE_SOLVERS[integrator.name]
    return type(integrator.name, (FixedRungeKutta,), {"tableau": integrator.coefficients})


def takes_jacobian(integrator: Integrator, kernels: Kernels) -> bool:
    """True if an integrator uses ∂ẏ/∂y and it is known: forces of Python functions have no derivative."""
    return integrator.takes_jacobian and not kernels.model.callbacks
