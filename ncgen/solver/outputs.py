"""What a model's outputs are along a motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ncgen.mechanism.functions import Functions, functions
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.model.elements import rate_name
from ncgen.model.expressions import is_symbolic, symbols_in

INPUTS = {"outputs": ("t", "q", "qd", "qdd", "p")}
"""The program of `ncgen.program.outputs`, and what it takes."""


def outputs_of(
    kernels: Kernels, t: Sequence[float] | np.ndarray, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """All outputs (K, outputs) at K instants t (s), with q, qd, qdd (K, n) and parameters p (n_p,)."""
    function = _function(kernels)
    instants = zip(t, q, qd, qdd, strict=True)
    found = [function("outputs", float(now), *state, kernels.present(float(now), p)) for now, *state in instants]
    return np.array(found).reshape(len(found), len(kernels.model.outputs))


def _function(kernels: Kernels) -> Functions:
    return kernels.remember("outputs", (), lambda: _made(kernels))


def _made(kernels: Kernels) -> Functions:
    from ncgen.program.outputs import assemble_outputs

    sizes = {"outputs": len(kernels.model.outputs)}
    return functions(kernels, "outputs", INPUTS, sizes, lambda: {"outputs": assemble_outputs(kernels.programs.equations)})


def uses_accelerations(model: Model) -> bool:
    """True if an output mentions an acceleration, which takes longer to find."""
    names = {rate_name(rate_name(c.name)) for c in model.components if not c.fixed}
    expressions = [output.expression for output in model.outputs.values()]
    return any(s.name in names for e in expressions if is_symbolic(e) for s in symbols_in(e))
