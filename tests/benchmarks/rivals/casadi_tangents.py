"""CasADi in the place of the tangent kernels: from Φ, M and Q alone, derivatives of the balance and of Φ̈ by q and q̇."""

from __future__ import annotations

import copy
from importlib import import_module
from types import ModuleType
from typing import Any

from benchmarks.rivals.casadi import LARGEST, graph
from benchmarks.rivals.translation import translatable
from ncgen.mechanism.kernels import Kernels


def with_tangents(kernels: Kernels) -> Kernels | None:
    """The same kernels whose stiffness, damping, phidd_q and phidd_qd CasADi differentiates and evaluates, at t = 0 and p0.

    None where CasADi is not installed, the mechanism depends on more than q and q̇, or is large.
    """
    try:
        casadi = import_module("casadi")
    except ImportError:
        return None
    if not translatable(kernels) or kernels.model.callbacks or kernels.m > LARGEST:
        return None
    q, qd, qdd = (casadi.SX.sym(name, kernels.n) for name in ("q", "qd", "qdd"))
    lam = casadi.SX.sym("lam", kernels.m)
    phi = graph(casadi, kernels, "phi", {"q": q})
    balance = _inertia(casadi, kernels, q, qdd) + casadi.jtimes(phi, q, lam, True) - graph(casadi, kernels, "force", {"q": q, "qd": qd})
    phidd = casadi.jtimes(phi, q, qdd) + casadi.jtimes(casadi.jtimes(phi, q, qd), q, qd)
    wanted = {
        "stiffness": (balance, q, (q, qd, qdd, lam)),
        "damping": (balance, qd, (q, qd)),
        "phidd_q": (phidd, q, (q, qd, qdd)),
        "phidd_qd": (phidd, qd, (q, qd)),
    }
    other = copy.copy(kernels)
    for name, (function, by, inputs) in wanted.items():
        made = casadi.Function(name, list(inputs), [casadi.jacobian(function, by)])
        setattr(other, name, lambda *given, made=made: made(*given[: made.n_in()]).sparse())
    return other


def _inertia(casadi: ModuleType, kernels: Kernels, q: Any, qdd: Any) -> Any:
    """M q̈, of expressions of CasADi."""
    M = casadi.SX(kernels.n, kernels.n)
    if "mass" in kernels.programs.programs:
        values = graph(casadi, kernels, "mass", {"q": q})
        for number, (row, column) in enumerate(kernels.mass_pattern.positions()):
            M[row, column] = values[number]
    return M @ qdd
