"""Motions as functions of JAX with exact derivatives, for jax.jit, jax.grad, jax.jacrev and jax.vmap (extra `jax`).

    functions = ncgen.jax(kernels)
    motion = functions.motion(0.5, 100)
    q, qd = motion(p, rates)  # (101, n) each
    jax.grad(lambda p: motion(p, rates)[0][-1, 0] ** 2)(p)

JAX calls the run in C, and the sweep back through it; under vmap one after the other.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeAlias, Unpack

import numpy as np

from ncgen.errors import ModelError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.elements import coordinate_of
from ncgen.solver.given import checked_kernels
from ncgen.solver.run import InitialArguments
from ncgen.solver.sensitivity import Motion, motion_of

Array: TypeAlias = Any
"""An array of JAX, or what JAX takes for one."""


def jax(kernels: Kernels) -> JaxFunctions:
    """A mechanism's motions for JAX. Raises ModelError where JAX is not installed or computes with 32 bits."""
    return JaxFunctions(checked_kernels(kernels))


class JaxFunctions:
    """Makes functions that JAX can transform."""

    def __init__(self, kernels: Kernels) -> None:
        try:
            library = import_module("jax")
        except ImportError:
            raise ModelError("ncgen.jax needs JAX; pip install 'ncgen[jax]'") from None
        if not library.config.read("jax_enable_x64"):
            raise ModelError("ncgen.jax: JAX computes with 32 bits; say jax.config.update('jax_enable_x64', True) before")
        self.kernels = kernels

    def motion(
        self, duration: float, steps: int, integrator: str = "rk4", **start: Unpack[InitialArguments]
    ) -> Callable[[Array, Array], tuple[Array, Array]]:
        """A function (p, rates) -> (q, q̇), (steps + 1, n) each: the motion with parameters p, (n_p,), and initial rates of the independent
        coordinates, (nz,), in the order of `rates_of`.

        duration (s), steps, integrator, start: as of `ncgen.sensitivities`, with its errors; p and zd0 are what the function is given
        Reverse mode: jax.grad, jax.jacrev, jax.vjp. Raises ModelError for arrays of other shapes.
        """
        if {"p", "zd0", "qd0"} & start.keys():
            raise ModelError("ncgen.jax: p and the initial rates are the motion's own arguments; leave p, zd0 and qd0 out")
        return _Motion(self.kernels, (duration, steps, integrator), dict(start)).function()

    def rates_of(self, **start: Unpack[InitialArguments]) -> tuple[str, ...]:
        """The independent coordinates whose rates a motion takes."""
        return _rates(motion_of(self.kernels, 1e-9, 1, "rk4", **start).names)


def _rates(names: tuple[str, ...]) -> tuple[str, ...]:
    """The coordinates whose rates are among the names of derivatives."""
    return tuple(coordinate for name in names if (coordinate := coordinate_of(name)) != name)


class _Motion:
    """One motion, and the last run of it: the sweep back asks for the one that has just been made."""

    def __init__(self, kernels: Kernels, asked: tuple[float, int, str], start: dict[str, Any]) -> None:
        self.kernels, self.asked, self.start = kernels, asked, start
        self.last: tuple[bytes, Motion] | None = None
        self.rates = len(_rates(self._run(kernels.p0, None).names))

    def function(self) -> Callable[[Array, Array], tuple[Array, Array]]:
        jax = import_module("jax")
        seen = jax.ShapeDtypeStruct((self.asked[1] + 1, self.kernels.n), np.float64)
        given = tuple(jax.ShapeDtypeStruct((size,), np.float64) for size in (len(self.kernels.p0), self.rates))

        def call(function: Callable[..., Any], shapes: Any, *arrays: Array) -> Any:
            return jax.pure_callback(function, shapes, *arrays, vmap_method="sequential")

        @jax.custom_vjp
        def moved(p: Array, rates: Array) -> Any:
            return call(self._forward, (seen, seen), p, rates)

        moved.defvjp(lambda p, rates: (moved(p, rates), (p, rates)), lambda here, by: call(self._back, given, *here, *by))

        def motion(p: Array, rates: Array) -> tuple[Array, Array]:
            p, rates = jax.numpy.asarray(p, float), jax.numpy.asarray(rates, float)
            for name, array, shape in (("p", p, given[0].shape), ("rates", rates, given[1].shape)):
                if array.shape != shape:
                    raise ModelError(f"{self.kernels.name}: {name} has shape {array.shape}; it must be {shape}")
            return moved(p, rates)

        return motion

    def _forward(self, p: Array, rates: Array) -> tuple[np.ndarray, np.ndarray]:
        run = self._run(np.array(p), np.array(rates))
        return run.q, run.qd

    def _back(self, p: Array, rates: Array, by_q: Array, by_qd: Array) -> tuple[np.ndarray, np.ndarray]:
        slopes, _ = self._run(np.array(p), np.array(rates)).backward(np.array(by_q), np.array(by_qd))
        return slopes[: len(self.kernels.p0)], slopes[len(slopes) - self.rates :]

    def _run(self, p: np.ndarray, rates: np.ndarray | None) -> Motion:
        key = p.tobytes() + (rates.tobytes() if rates is not None else b"")
        if self.last is None or self.last[0] != key:
            self.last = key, motion_of(self.kernels, *self.asked, p=p, zd0=rates, **self.start)
        return self.last[1]
