"""Accelerations by a user's own object, checked, with the multipliers of least squares that belong to them."""

from __future__ import annotations

import numpy as np

from ncgen.errors import ModelError, SingularError, shown
from ncgen.methods.own_formalism import OwnFormalism
from ncgen.solver.formalisms.instant import InstantMatrices


def solved_by(formalism: OwnFormalism, now: InstantMatrices) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations (n,) of the object and multipliers (k,): Φ_qᵀ λ = Q − M q̈. Raises what the object's function raises."""
    for matrix in (now.mass, now.jacobian, now.force, now.gamma):
        matrix.flags.writeable = False  # the multipliers need them as they are
    returned, where = formalism.accelerations(now), f"formalism {shown(formalism.name)}"
    try:
        x = None if np.iscomplexobj(returned) else np.array(returned, dtype=float)
    except (TypeError, ValueError):
        x = None
    if x is None or x.shape != now.force.shape:
        raise ModelError(f"{where}: accelerations returned {shown(returned)}; return {len(now.force)} numbers, one a coordinate")
    if not np.all(np.isfinite(x)):
        raise SingularError(f"{now.kernels.name}: {where} returned accelerations that are not finite")
    return x, np.linalg.lstsq(now.jacobian.T, now.force - now.mass @ x, rcond=None)[0]
