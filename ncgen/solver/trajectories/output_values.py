"""What a model's outputs are along a motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from ncgen.mechanism.kernels import Kernels
from ncgen.mechanism.program_functions import ProgramFunctions, functions
from ncgen.model import Model
from ncgen.model.elements import rate_name
from ncgen.model.expressions import is_symbolic, symbols_in
from ncgen.model.outputs import Output, is_load
from ncgen.program.ir.blocks import Program

INPUTS = {"outputs": ("t", "q", "qd", "qdd", "lam", "p"), "outputs_tangent": ("t", "q", "qd", "qdd", "lam", "p", "seed")}
"""The programs of `ncgen.program.motions.output_programs`, and what they take."""

Found: TypeAlias = "tuple[np.ndarray, np.ndarray]"
"""Accelerations (K, n) and multipliers (K, m) of K instants."""


def outputs_of(
    kernels: Kernels,
    t: Sequence[float] | np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    p: np.ndarray,
    accelerations_and_loads: Found | None = None,
) -> np.ndarray:
    """All outputs (K, outputs) at K instants t (s), with q, qd (K, n) and parameters p (n_p,); found: where `uses_accelerations`."""
    function, (qdd, lam) = _function(kernels), accelerations_and_loads or (np.zeros_like(q), np.zeros((len(q), kernels.m)))
    instants = zip(t, q, qd, qdd, lam, strict=True)
    rows = [function("outputs", float(now), *state, kernels.present(float(now), p)) for now, *state in instants]
    return np.array(rows).reshape(len(rows), len(kernels.model.outputs))


def output_slopes(kernels: Kernels, t: float, state: Sequence[np.ndarray], p: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """How the outputs change along directions (k, 3 n + m + n_p) of q, q̇, q̈, λ and p at state = (q, q̇, q̈, λ): (outputs, k)."""
    function = _function(kernels)
    rows = [function("outputs_tangent", t, *state, p, np.ascontiguousarray(seed)) for seed in directions]
    return np.array(rows).reshape(len(directions), len(kernels.model.outputs)).T


def load_slopes(kernels: Kernels, t: float, state: Sequence[np.ndarray], p: np.ndarray) -> np.ndarray:
    """∂ outputs / ∂ loads, (outputs, loads), at state = (q, q̇, q̈, λ, loads), as `assemble_load_slopes` has them."""
    function = kernels.remember("load slopes", (), lambda: _slopes_made(kernels))
    *_, felt = state
    return np.array([function("load_slopes", t, *state, p, seed) for seed in np.eye(len(felt))]).T


def _slopes_made(kernels: Kernels) -> ProgramFunctions:
    from ncgen.program.motions.full_loads import loaded_elements
    from ncgen.program.motions.output_programs import LOAD_INPUTS, assemble_load_slopes

    inputs, sizes = {"load_slopes": LOAD_INPUTS}, {"load_slopes": len(kernels.model.outputs)}
    felt = 3 * len(loaded_elements(kernels.programs.equations))
    counts = _counts(kernels) | {"felt": felt, "seed": felt}
    return functions(
        kernels, "load_slopes", inputs, sizes, counts, lambda: {"load_slopes": assemble_load_slopes(kernels.programs.equations)}
    )


def _counts(kernels: Kernels) -> dict[str, int]:
    """{input: how many numbers it has}."""
    counts = dict.fromkeys(("q", "qd", "qdd"), kernels.n) | {"lam": kernels.m, "p": len(kernels.p0)}
    return counts | {"seed": sum(counts.values())}


def _function(kernels: Kernels) -> ProgramFunctions:
    return kernels.remember("outputs", (), lambda: _made(kernels))


def _made(kernels: Kernels) -> ProgramFunctions:
    from ncgen.program.motions.output_programs import assemble_outputs

    sizes, counts = dict.fromkeys(INPUTS, len(kernels.model.outputs)), _counts(kernels)

    def programs() -> dict[str, Program]:
        return dict(zip(INPUTS, assemble_outputs(kernels.programs.equations), strict=True))

    return functions(kernels, "outputs", INPUTS, sizes, counts, programs)


def uses_accelerations(model: Model) -> bool:
    """True if an output mentions an acceleration or a load, which take longer to find."""
    accelerations = {rate_name(rate_name(c.name)) for c in model.components if not c.fixed}
    return uses_loads(model) or any(accelerations & mentioned(output) for output in model.outputs.values())


def uses_loads(model: Model) -> bool:
    """True if an output mentions a joint load or a driver force."""
    return any(is_load(name) for output in model.outputs.values() for name in mentioned(output))


def mentioned(output: Output) -> set[str]:
    """The names that an output mentions."""
    return {s.name for s in symbols_in(output.expression)} if is_symbolic(output.expression) else set()
