"""Motions as functions of PyTorch with exact derivatives, for autograd and torch.func (extra `torch`).

    functions = ncgen.torch(kernels)
    motion = functions.motion(0.5, 100)
    q, qd = motion(p, rates)  # (101, n) each; with leading axes many motions at once
    (q[-1, 0] ** 2).backward()

PyTorch calls the run in C, and the sweep back through it; those of many motions go side by side in lanes and threads.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any, TypeAlias, Unpack

import numpy as np

from ncgen.errors import ModelError
from ncgen.exchange.motion_functions import ArrayFunction, MotionFunction, rates_of
from ncgen.mechanism.kernels import Kernels
from ncgen.solver.argument_checks import checked_kernels
from ncgen.solver.derivatives.sensitivity import NOT_DIFFERENTIATED
from ncgen.solver.groups import MotionArguments, takes

Tensor: TypeAlias = Any
"""A tensor of PyTorch, on the processor, or what it takes for one."""


def torch(kernels: Kernels) -> TorchFunctions:
    """Make functions of a mechanism's motions for PyTorch.

    Parameters
    ----------
    kernels : Kernels
        Compiled mechanism.

    Returns
    -------
    TorchFunctions
        Functions that PyTorch can differentiate.

    Raises
    ------
    ModelError
        Where PyTorch is not installed.
    """
    return TorchFunctions(checked_kernels(kernels))


class TorchFunctions:
    """Makes functions that PyTorch differentiates."""

    def __init__(self, kernels: Kernels) -> None:
        try:
            import_module("torch")
        except ImportError:
            raise ModelError("ncgen.torch needs PyTorch; pip install 'ncgen[torch]'") from None
        self.kernels = kernels

    @takes(MotionArguments, unused=NOT_DIFFERENTIATED)
    def motion(
        self, duration: float, steps: int, **arguments: Unpack[MotionArguments]
    ) -> Callable[[Tensor, Tensor], tuple[Tensor, Tensor]]:
        """A function (p, rates) -> (q, q̇), (…, steps + 1, n) each: the motion with parameters p, (…, n_p), and initial rates of the
        independent coordinates, (…, nz), in the order of `rates_of`, in doubles. Leading axes are those of many motions, and broadcast.

        duration (s), steps, arguments: as of `ncgen.sensitivities`, with its errors; p and zd0 are what the function is given
        First derivatives, by autograd and torch.func. Raises ModelError for tensors of other shapes or types.
        """
        return _in_torch(MotionFunction(self.kernels, "ncgen.torch", (duration, steps), dict(arguments)))

    @takes(MotionArguments, unused=NOT_DIFFERENTIATED)
    def rates_of(self, **arguments: Unpack[MotionArguments]) -> tuple[str, ...]:
        """The independent coordinates whose rates a motion takes."""
        return rates_of(self.kernels, dict(arguments))


def _in_torch(function: MotionFunction) -> Callable[[Tensor, Tensor], tuple[Tensor, Tensor]]:
    library, moved = import_module("torch"), _autograd()

    def motion(p: Tensor, rates: Tensor) -> tuple[Tensor, Tensor]:
        p, rates = (_doubles(array, name, function.kernels.name) for array, name in ((p, "p"), (rates, "rates")))
        function.checked(p.shape[-1:], rates.shape[-1:])
        try:
            leading = library.broadcast_shapes(p.shape[:-1], rates.shape[:-1])
        except RuntimeError:
            leading = None
        if leading is None or 0 in leading:
            shapes = f"{tuple(p.shape)} and {tuple(rates.shape)}"
            raise ModelError(f"{function.kernels.name}: p and rates have shapes {shapes}, which do not fit one batch of motions")
        return moved.apply(function, p.expand(*leading, -1), rates.expand(*leading, -1))

    return motion


def _doubles(array: Tensor, name: str, whose: str) -> Tensor:
    """An argument as a tensor of doubles on the processor. Raises ModelError for what is not one."""
    library = import_module("torch")
    try:
        tensor = library.as_tensor(array.copy() if isinstance(array, np.ndarray) else array)  # PyTorch warns of what cannot be written to
    except (TypeError, ValueError, RuntimeError):
        raise ModelError(f"{whose}: {name} is no array of numbers") from None
    if tensor.dtype.is_complex or tensor.dtype == library.bool:
        raise ModelError(f"{whose}: {name} is of type {str(tensor.dtype).removeprefix('torch.')}; it must be real numbers")
    if tensor.device.type != "cpu":
        raise ModelError(f"{whose}: {name} is on {tensor.device}; motions are computed by the processor: give {name}.cpu()")
    return tensor.to(library.float64)


@cache
def _autograd() -> Any:
    """The function that autograd knows, and the reverse sweep as another, each of one or many motions; made once PyTorch is there."""
    library = import_module("torch")

    def call(function: ArrayFunction, *tensors: Tensor) -> tuple[Tensor, ...]:
        return tuple(map(library.from_numpy, function(*(x.detach().numpy() for x in tensors))))  # in the same memory

    def mapped(which: Any, info: Any, dims: tuple[int | None, ...], function: MotionFunction, *tensors: Tensor) -> tuple[Any, Any]:
        """Under vmap: the mapped axes to the front, where leading ones are those of many motions."""
        front = [x.expand(info.batch_size, *x.shape) if d is None else x.movedim(d, 0) for x, d in zip(tensors, dims[1:], strict=True)]
        return which.apply(function, *front), (0, 0)

    class Back(library.autograd.Function):
        @staticmethod
        def forward(function: MotionFunction, *tensors: Tensor) -> tuple[Tensor, ...]:
            return call(function.backward, *tensors)

        @staticmethod
        def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
            pass

        @staticmethod
        def backward(ctx: Any, *by: Tensor) -> Any:
            raise ModelError("ncgen.torch: motions have first derivatives only; take ncgen.hessian for second ones")

        @staticmethod
        def vmap(info: Any, dims: Any, *arguments: Any) -> Any:
            return mapped(Back, info, dims, *arguments)

    class MotionInTorch(library.autograd.Function):
        @staticmethod
        def forward(function: MotionFunction, p: Tensor, rates: Tensor) -> tuple[Tensor, ...]:
            return call(function.forward, p, rates)

        @staticmethod
        def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
            ctx.function = inputs[0]
            ctx.save_for_backward(*inputs[1:])

        @staticmethod
        def backward(ctx: Any, by_q: Tensor, by_qd: Tensor) -> Any:
            return (None, *Back.apply(ctx.function, *ctx.saved_tensors, by_q, by_qd))

        @staticmethod
        def vmap(info: Any, dims: Any, *arguments: Any) -> Any:
            return mapped(MotionInTorch, info, dims, *arguments)

    return MotionInTorch
