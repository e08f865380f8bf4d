"""Motions as functions of JAX with exact derivatives, for jax.jit, jax.grad, jax.jacrev and jax.vmap (extra `jax`).

    functions = ncgen.jax(kernels)
    motion = functions.motion(0.5, 100)
    q, qd = motion(p, rates)  # (101, n) each
    jax.grad(lambda p: motion(p, rates)[0][-1, 0] ** 2)(p)

JAX calls the run in C, and the sweep back through it; under vmap those of all motions, side by side in lanes and threads.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeAlias, Unpack

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.motion_functions import MotionFunction, rates_of
from ncgen.exchange.xla import operation
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.argument_checks import checked_kernels
from ncgen.solver.derivatives.sensitivity import NOT_DIFFERENTIATED
from ncgen.solver.groups import MotionArguments, takes

Array: TypeAlias = Any
"""An array of JAX, or what JAX takes for one."""


def jax(kernels: Kernels) -> JaxFunctions:
    """Make functions of a mechanism's motions for JAX.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.

    Returns
    -------
    JaxFunctions
        Functions that JAX can differentiate.

    Raises
    ------
    ModelError
        Where JAX is not installed, or computes with 32 bits.
    """
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

    @takes(MotionArguments, unused=NOT_DIFFERENTIATED)
    def motion(self, duration: float, steps: int, **arguments: Unpack[MotionArguments]) -> Callable[[Array, Array], tuple[Array, Array]]:
        """A function (p, rates) -> (q, q̇), (steps + 1, n) each: the motion with parameters p, (n_p,), and initial rates of the independent
        coordinates, (nz,), in the order of `rates_of`.

        duration (s), steps, arguments: as of `ncgen.sensitivities`, with its errors; p and zd0 are what the function is given
        Reverse mode: jax.grad, jax.jacrev, jax.vjp. Raises ModelError for arrays of other shapes, and for numbers that are not real.
        """
        return _in_jax(MotionFunction(self.kernels, "ncgen.jax", (duration, steps), dict(arguments)))

    @takes(MotionArguments, unused=NOT_DIFFERENTIATED)
    def rates_of(self, **arguments: Unpack[MotionArguments]) -> tuple[str, ...]:
        """The independent coordinates whose rates a motion takes."""
        return rates_of(self.kernels, dict(arguments))


def _in_jax(function: MotionFunction) -> Callable[[Array, Array], tuple[Array, Array]]:
    jax = import_module("jax")
    forward, backward = operation(function.forward), operation(function.backward)
    moved = jax.custom_vjp(forward)
    moved.defvjp(lambda p, rates: (forward(p, rates), (p, rates)), lambda arguments, by: backward(*arguments, *by))

    def motion(p: Array, rates: Array) -> tuple[Array, Array]:
        p, rates = (_real(array, name, function.kernels.name) for array, name in ((p, "p"), (rates, "rates")))
        function.checked(p.shape, rates.shape)
        if isinstance(p, jax.core.Tracer) or isinstance(rates, jax.core.Tracer):
            return moved(p, rates)
        q, qd = function.forward(np.asarray(p), np.asarray(rates))  # what is wrong with numbers is told in our own words
        return jax.numpy.asarray(q), jax.numpy.asarray(qd)

    return motion


def _real(array: Array, name: str, whose: str) -> Array:
    """An argument as an array of doubles. Raises ModelError for numbers that are not real."""
    jax = import_module("jax")
    try:
        converted = jax.numpy.asarray(array)
    except (TypeError, ValueError):
        raise ModelError(f"{whose}: {name} is no array of numbers") from None
    if not (jax.numpy.issubdtype(converted.dtype, jax.numpy.floating) or jax.numpy.issubdtype(converted.dtype, jax.numpy.integer)):
        raise ModelError(f"{whose}: {name} is of type {converted.dtype}; it must be real numbers")
    return converted.astype(float)
