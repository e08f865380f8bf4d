"""Integrators by name: SciPy's own names, the field's, and those of Matlab that the paper uses."""

from __future__ import annotations

import warnings

import numpy as np
import scipy.integrate

from ncgen.errors import ModelError
from ncgen.solver.hermite import Hermite
from ncgen.solver.sundials import CvodeAdams, CvodeBdf
from ncgen.solver.trapezoidal import Trapezoidal


class Adams(scipy.integrate.OdeSolver):
    """Variable-order Adams (VODE) as a SciPy step-by-step solver: the paper's ode113."""

    def __init__(self, fun, t0, y0, t_bound, rtol=1e-3, atol=1e-6, max_step=np.inf, vectorized=False, first_step=None, **extra):
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self._engine = scipy.integrate.ode(self.fun).set_integrator(
            "vode", method="adams", rtol=rtol, atol=atol, max_step=0.0 if np.isinf(max_step) else max_step,
            first_step=first_step or 0.0, nsteps=100000,
        )  # fmt: skip
        self._engine.set_initial_value(y0, t0)

    def _step_impl(self):
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            try:
                self._engine.integrate(self.t_bound, step=True)
            except UserWarning as problem:
                return False, str(problem)
        self.t, self.y = self._engine.t, self._engine.y.copy()
        if self.direction * (self.t - self.t_bound) > 0:
            # VODE steps past the end; come back by its own interpolation.
            self.y = self._engine.integrate(self.t_bound).copy()
            self.t = self.t_bound
        return True, None

    def _dense_output_impl(self):
        return _Nordsieck(self.t_old, self.t, self._engine)


class _Nordsieck(scipy.integrate.DenseOutput):
    """VODE's own interpolation within its last step, of the order of the method."""

    def __init__(self, t0, t1, engine):
        super().__init__(t0, t1)
        self._engine = engine

    def _call_impl(self, t):
        return self._engine.integrate(t).copy()


class RungeKutta4(scipy.integrate.OdeSolver):
    """The classical fourth-order method with a fixed step, `max_step`."""

    has_fixed_step = True

    def __init__(self, fun, t0, y0, t_bound, max_step=np.inf, vectorized=False, first_step=None, **extra):
        super().__init__(fun, t0, y0, t_bound, vectorized)
        if not np.isfinite(max_step):
            raise ModelError("rk4 has a fixed step: give max_step in seconds")
        self._step = max_step if first_step is None else min(max_step, first_step)
        self.f = self.fun(t0, self.y)

    def _step_impl(self):
        t, y, h = self.t, self.y, min(self._step, self.t_bound - self.t)
        k1 = self.f
        k2 = self.fun(t + h / 2, y + h / 2 * k1)
        k3 = self.fun(t + h / 2, y + h / 2 * k2)
        k4 = self.fun(t + h, y + h * k3)
        new = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        self.t = self.t_bound if t + h >= self.t_bound else t + h
        self._previous = (t, y, k1)
        self.y, self.f = new, self.fun(self.t, new)
        return True, None

    def _dense_output_impl(self):
        return Hermite(*self._previous, self.t, self.y, self.f)


def replace_state(solver: scipy.integrate.OdeSolver, y: np.ndarray) -> None:
    """Put a slightly corrected state in place of an accepted one; the method goes on from it with its history as it is.

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
        solver.f = solver.fun(solver.t, y)


INTEGRATORS = {
    "rk4": RungeKutta4,
    "rk23": scipy.integrate.RK23,
    "dopri5": scipy.integrate.RK45,
    "dop853": scipy.integrate.DOP853,
    "adams": Adams,
    "bdf": scipy.integrate.BDF,
    "radau": scipy.integrate.Radau,
    "lsoda": scipy.integrate.LSODA,
    "trapezoidal": Trapezoidal,
    "cvode-adams": CvodeAdams,
    "cvode-bdf": CvodeBdf,
}
"""Integrators by their names in the field; all but rk4 and trapezoidal choose their steps by themselves."""

OTHER_NAMES = {
    "rk45": "dopri5",
    "ode45": "dopri5",
    "ode23": "rk23",
    "ode113": "adams",
    "ode15s": "bdf",
}
"""SciPy's and Matlab's names for the same methods."""


IMPLICIT = (scipy.integrate.BDF, scipy.integrate.Radau, scipy.integrate.LSODA, Trapezoidal, CvodeBdf)


def takes_jacobian(method: type, kernels) -> bool:
    """True if an integrator uses ∂ẏ/∂y and it is known: forces of Python functions have no derivative."""
    return method in IMPLICIT and not kernels.model.callbacks


def find_integrator(name: str):
    """The integrator class of a name, upper or lower case. Raises ModelError listing the known ones."""
    key = canonical_name(name)
    if key not in INTEGRATORS:
        raise ModelError(f"integrator {name!r} is unknown; choose one of {', '.join([*INTEGRATORS, *OTHER_NAMES])}")
    return INTEGRATORS[key]


def canonical_name(name: str) -> str:
    """The name in the field of an integrator given by any of its names."""
    key = str(name).lower()
    return OTHER_NAMES.get(key, key)
