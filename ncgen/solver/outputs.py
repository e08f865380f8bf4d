"""What a model's outputs are along a motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ncgen.mechanism.functions import Functions, functions
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.model.elements import rate_name
from ncgen.model.expressions import is_symbolic, symbols_in

INPUTS = {"outputs": ("t", "q", "qd", "qdd", "p"), "outputs_tangent": ("t", "q", "qd", "qdd", "p", "seed")}
"""The programs of `ncgen.program.outputs`, and what they take."""


def outputs_of(
    kernels: Kernels, t: Sequence[float] | np.ndarray, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """All outputs (K, outputs) at K instants t (s), with q, qd, qdd (K, n) and parameters p (n_p,)."""
    function = _function(kernels)
    instants = zip(t, q, qd, qdd, strict=True)
    found = [function("outputs", float(now), *state, kernels.present(float(now), p)) for now, *state in instants]
    return np.array(found).reshape(len(found), len(kernels.model.outputs))


def output_slopes(kernels: Kernels, t: float, state: Sequence[np.ndarray], p: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """How the outputs change along directions (k, 3 n + n_p) of q, q̇, q̈ and p at state = (q, q̇, q̈): (outputs, k)."""
    function = _function(kernels)
    found = [function("outputs_tangent", t, *state, p, np.ascontiguousarray(seed)) for seed in directions]
    return np.array(found).reshape(len(directions), len(kernels.model.outputs)).T


def _function(kernels: Kernels) -> Functions:
    return kernels.remember("outputs", (), lambda: _made(kernels))


def _made(kernels: Kernels) -> Functions:
    from ncgen.program.outputs import assemble_outputs

    sizes = dict.fromkeys(INPUTS, len(kernels.model.outputs))
    return functions(
        kernels, "outputs", INPUTS, sizes, lambda: dict(zip(INPUTS, assemble_outputs(kernels.programs.equations), strict=True))
    )


def uses_accelerations(model: Model) -> bool:
    """True if an output mentions an acceleration, which takes longer to find."""
    names = {rate_name(rate_name(c.name)) for c in model.components if not c.fixed}
    expressions = [output.expression for output in model.outputs.values()]
    return any(s.name in names for e in expressions if is_symbolic(e) for s in symbols_in(e))
