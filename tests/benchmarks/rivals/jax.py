"""JAX: Φ traced and differentiated forward, compiled by XLA.

Any: an array of JAX, or what stands for one while a function is traced.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.rivals.translation import translatable
from ncgen.comparisons.rivals.base import Inputs, Rival, called, nonzeros
from ncgen.mechanism.kernels import Kernels
from ncgen.program.ir.evaluate import evaluate
from ncgen.program.ir.functions import FUNCTIONS

LARGEST = 200
"""Rows up to which the scalar operations of Φ are traced one by one."""


def rivals(kernels: Kernels, inputs: Inputs, names: Sequence[str]) -> list[Rival]:
    """Nothing where JAX is not installed."""
    try:
        jax = import_module("jax")
    except ImportError:
        return []
    if not translatable(kernels) or kernels.m > LARGEST:
        return []
    jnp = jax.numpy
    functions = {name: getattr(jnp, f.numpy) for name, f in FUNCTIONS.items()}
    program = kernels.programs.programs["phi"]

    def phi(q: Any) -> Any:
        return jnp.stack([jnp.asarray(x) for x in evaluate(program, {"t": 0.0, "q": q, "p": kernels.p0}, functions)])

    def rate(q: Any, qd: Any) -> Any:
        return jax.jvp(phi, (q,), (qd,))[1]

    def gamma(q: Any, qd: Any) -> Any:
        return -jax.jvp(lambda x: rate(x, qd), (q,), (qd,))[1]

    made = {"phi": (jax.jit(phi), 1), "phi_q": (jax.jit(jax.jacfwd(phi)), 1), "gamma": (jax.jit(gamma), 2)}
    with jax.experimental.enable_x64() if hasattr(jax.experimental, "enable_x64") else jax.enable_x64(True):
        given = (jnp.asarray(inputs.q), jnp.asarray(inputs.qd))
        start = time.perf_counter()
        ready = {k: made[k][0].lower(*given[: made[k][1]]).compile() for k in names if k in made}
        seconds = time.perf_counter() - start
    calls = {k: lambda f=f, k=k: f(*given[: made[k][1]]).block_until_ready() for k, f in ready.items()}
    values = {k: lambda k=k: nonzeros(kernels, k, np.asarray(calls[k]())) for k in calls}
    return [called("JAX, jit(jacfwd)", calls, lambda k: values[k](), compilation=seconds)]
