"""SUNDIALS' CVODE as SciPy step-by-step solvers, through scikit-sundae, which is installed with `ncgen[sundials]`.

CVODE keeps its history to itself, so a state cannot be corrected between steps: these go with coordinate partitioning alone.
"""

from __future__ import annotations

import contextlib
import io
from importlib import import_module
from typing import Any

import numpy as np
from scipy.integrate import DenseOutput

from ncgen.errors import ModelError
from ncgen.solver.integrators.caught import Asked, ForeignSolver
from ncgen.solver.integrators.ode import Slope


class Cvode(ForeignSolver):
    """One of CVODE's families of methods (Hindmarsh et al. 2005, doi 10.1145/1089014.1089020), variable in step and order."""

    family: str
    _jac: Slope

    def _begun(self, jac: Slope | None, **options: float | np.ndarray) -> Any:
        slope = {}
        if jac is not None:
            self._jac, slope = jac, {"jacfn": self._fill_jacobian}
        engine = _cvode()(self._fill, method=self.family, **options, **slope)
        engine.init_step(self.t, self.y.copy())
        return engine

    def _fill(self, t: float, y: np.ndarray, yp: np.ndarray) -> None:
        yp[:] = self._caught.call(self.fun, t, y)

    def _fill_jacobian(self, t: float, y: np.ndarray, yp: np.ndarray, slopes: np.ndarray) -> None:
        slopes[:, :] = self._caught.call(self._jac, t, y)

    def _step_impl(self) -> tuple[bool, str | None]:
        with contextlib.redirect_stdout(io.StringIO()):  # scikit-sundae prints CVODE's failures; they are raised below
            outcome = self._engine.step(self.t_bound, method="onestep", tstop=self.t_bound)
        self._caught.raise_caught()
        if outcome.status < 0 or not np.all(np.isfinite(outcome.y)):
            return False, str(outcome.message)
        self.t, self.y = float(np.ravel(outcome.t)[-1]), np.atleast_2d(outcome.y)[-1].copy()
        return True, None

    def _dense_output_impl(self) -> DenseOutput:
        return Asked(self, lambda t: np.atleast_2d(self._engine.step(t, method="normal").y)[-1])


class CvodeAdams(Cvode):
    """Adams methods of orders 1 to 12."""

    family = "Adams"


class CvodeBdf(Cvode):
    """Backward differentiation formulas of orders 1 to 5."""

    family = "BDF"


def _cvode() -> Any:
    try:
        return import_module("sksundae.cvode").CVODE
    except ImportError:
        raise ModelError("cvode-adams and cvode-bdf need scikit-sundae; install it with: pip install 'ncgen[sundials]'") from None
