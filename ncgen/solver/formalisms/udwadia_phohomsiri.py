"""Udwadia and Phohomsiri's equation: q̈ = [(1 − Φ_q⁺Φ_q) M; Φ_q]⁺ [(1 − Φ_q⁺Φ_q) Q; γ], for singular M and redundant rows.

Udwadia, Phohomsiri: Explicit equations of motion for constrained mechanical systems with singular mass matrices,
Proc. R. Soc. A 462 (2006), doi 10.1098/rspa.2006.1662. The multipliers are those of smallest norm.
"""

from __future__ import annotations

import numpy as np

from ncgen.model.singular_values import pseudoinverse, svd
from ncgen.solver.formalisms.instant import InstantMatrices
from ncgen.solver.formalisms.kkt import undetermined
from ncgen.solver.positions.rank import RELATIVE_ZERO

MIN_SINGULAR_VALUE = 1e-12
"""Singular values below this, relative to the largest, mean accelerations that are not determined."""


def udwadia_phohomsiri(now: InstantMatrices) -> tuple[np.ndarray, np.ndarray]:
    inverse = pseudoinverse(now.jacobian, RELATIVE_ZERO)
    allowed = np.eye(len(now.force)) - inverse @ now.jacobian
    stacked = np.vstack([allowed @ now.mass, now.jacobian])
    left, values, right = svd(stacked)
    if np.any(values <= MIN_SINGULAR_VALUE * np.max(values, initial=0.0)):
        raise undetermined(now.kernels, now.mass, now.jacobian)
    x = right.T @ ((left.T @ np.concatenate([allowed @ now.force, now.gamma])) / values)
    return x, inverse.T @ (now.force - now.mass @ x)
