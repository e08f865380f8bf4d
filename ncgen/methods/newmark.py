"""Newmark's formulas with the weights of the generalised-α method, and of HHT as its special case.

Arnold, Brüls: Convergence of the generalized-α scheme for constrained mechanical systems, Multibody Syst. Dyn. 18 (2007),
doi 10.1007/s11044-007-9084-0.
"""

from __future__ import annotations


def newmark(rho: float, hht: float | None) -> tuple[float, float, float, float]:
    """Return αm, αf, β and γ, of ρ∞ from 0 (most damping of high frequencies) to 1 (none), or of HHT's α from 0 to 1/3 in its place."""
    alpha_m, alpha_f = (0.0, hht) if hht is not None else ((2 * rho - 1) / (rho + 1), rho / (rho + 1))
    gamma = 0.5 - alpha_m + alpha_f
    return alpha_m, alpha_f, (gamma + 0.5) ** 2 / 4, gamma
