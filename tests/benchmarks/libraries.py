"""Many motions and their gradients inside JAX and PyTorch, beside the same by ncgen alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.util import find_spec
from typing import Any, TypeAlias

import numpy as np

import ncgen
from benchmarks.data import ALL, first_written_out
from ncgen.compiler import compile
from ncgen.errors import ModelError
from ncgen.exchange.jax_functions import jax
from ncgen.exchange.motion_functions import rates_of
from ncgen.exchange.torch_functions import torch
from ncgen.mechanism.kernels import Kernels
from ncgen.model import Model
from ncgen.report.clock import measure, repeated

MOTIONS, STEPS, DURATION = 1000, 80, 0.4
"""Motions of so many steps of rk4, and seconds."""

ASIDE = 0.03
"""How fast the independent coordinates begin at random, in their units a second."""

ROUNDS = 9

Calls: TypeAlias = dict[str, Callable[[], np.ndarray]]
"""{tool: call}; gradients are by parameters and initial rates, (MOTIONS, n_p + nz)."""


def library_records(model: Model) -> Iterator[dict]:
    """Records of many motions, and of gradients of a sum of their positions and velocities by all data and initial rates.

    seconds: a motion; ratio: to ncgen's own; error: beside ncgen's own, relative to the largest
    Raises ModelError where the mechanism's motion is not written out.
    """
    found = first_written_out(model, ALL)
    if found is None:
        raise ModelError(f"{model.name}: its motion is not emitted in C, so there is nothing to compare")
    many = _Many(compile(found[0], "c"))
    for title, calls in (("motions", many.moved()), ("gradients", many.back())):
        results = {tool: call() for tool, call in calls.items()}
        spent = measure({tool: repeated(call) for tool, call in calls.items()}, ROUNDS)
        own = results["ncgen"]
        for tool, spread in spent.items():
            error = None if tool == "ncgen" else float(np.max(np.abs(results[tool] - own)) / np.max(np.abs(own)))
            record = {"case": "libraries", "tool": f"{tool}, {title}", "error": error, "ratio": spread.median / spent["ncgen"].median}
            yield record | spread.seconds(MOTIONS)


class _Many:
    """Motions from random rates, the weights of all that is seen of them, and what computes both."""

    def __init__(self, kernels: Kernels) -> None:
        self.kernels, self.z = kernels, rates_of(kernels, {})
        draw = np.random.default_rng(1)
        self.rates = ASIDE * draw.standard_normal((MOTIONS, len(self.z)))
        self.by_q, self.by_qd = draw.standard_normal((2, STEPS + 1, kernels.n))
        self.jax = import_module("jax") if find_spec("jax") else None
        self.torch = import_module("torch") if find_spec("torch") else None
        if self.jax:
            self.jax.config.update("jax_enable_x64", True)

    def moved(self) -> Calls:
        """Positions at all instants, (MOTIONS, STEPS + 1, n)."""
        given = {"zd0": self.rates, "z": self.z, "integrator": "rk4", "max_step": DURATION / STEPS, "points": STEPS + 1}
        calls: Calls = {"ncgen": lambda: ncgen.simulate(self.kernels, DURATION, **given).q}
        if self.jax:
            motion = jax(self.kernels).motion(DURATION, STEPS)
            in_jax = self.jax.jit(self.jax.vmap(lambda rates: motion(self.kernels.p0, rates)))
            calls["JAX"] = lambda: np.asarray(in_jax(self.rates)[0])
        if self.torch:
            in_torch = torch(self.kernels).motion(DURATION, STEPS)
            calls["PyTorch"] = lambda: in_torch(self.kernels.p0, self.rates)[0].numpy()
        return calls

    def back(self) -> Calls:
        """Gradients of the weighted sum by parameters and rates, (MOTIONS, n_p + nz)."""
        kernels, count = self.kernels, len(self.kernels.p0)
        of_rates = slice(count + len(self.z), None)

        def own() -> np.ndarray:
            found = ncgen.gradient(
                kernels, DURATION, STEPS, lambda q, qd: (0.0, self.by_q, self.by_qd), zd0=self.rates, z=self.z
            ).derivatives
            return np.hstack([found[:, :count], found[:, of_rates]])

        calls: Calls = {"ncgen": own}
        if self.jax:
            motion = jax(kernels).motion(DURATION, STEPS)

            def number(p: Any, rates: Any) -> Any:
                q, qd = motion(p, rates)
                return (self.by_q * q).sum() + (self.by_qd * qd).sum()

            in_jax = self.jax.jit(self.jax.vmap(self.jax.grad(number, argnums=(0, 1)), in_axes=(None, 0)))
            calls["JAX"] = lambda: np.hstack([np.asarray(x) for x in in_jax(kernels.p0, self.rates)])
        if self.torch:
            in_torch, library = torch(kernels).motion(DURATION, STEPS), self.torch
            by_q, by_qd = map(library.from_numpy, (self.by_q, self.by_qd))

            def back() -> np.ndarray:
                given = [library.tensor(x, requires_grad=True) for x in (np.tile(kernels.p0, (MOTIONS, 1)), self.rates)]
                q, qd = in_torch(*given)
                found = library.autograd.grad((q, qd), given, (by_q.expand_as(q), by_qd.expand_as(qd)))
                return np.hstack([x.numpy() for x in found])

            calls["PyTorch"] = back
        return calls
