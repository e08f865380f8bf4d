"""A motion as a function of its parameters and initial rates, of one or many of them at a time, with the reverse sweep: what libraries that
differentiate call, in NumPy's arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from ncgen.errors import ModelError, NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.methods.table import INTEGRATORS
from ncgen.model.elements import coordinate_of
from ncgen.solver.derivatives.gradients import taped_batch
from ncgen.solver.derivatives.sensitivity import Motion, motion_of
from ncgen.solver.derivatives.taped_batch import Swept, TapedBatch

IN_LANES = {"integrator", "q0", "t0", "z"}
"""What motions that run side by side can be asked for besides their parameters and rates."""


def rates_of(kernels: Kernels, start: dict[str, Any]) -> tuple[str, ...]:
    """The independent coordinates whose rates a motion takes; start: as of `ncgen.sensitivities`."""
    initial = {name: value for name, value in start.items() if name not in ("integrator", "rtol", "options", "inputs")}
    names = motion_of(kernels, 1e-9, 1, **initial).names
    return tuple(coordinate for name in names if (coordinate := coordinate_of(name)) != name)


@dataclass(frozen=True, eq=False)
class ArrayFunction:
    """A function of arrays of one motion or, with leading axes that broadcast, of many: fill(*arguments, *results) writes what it finds
    where results are to be, a call to new memory.

    argument_shapes, result_shapes: shapes of arguments and results of one motion; all are doubles
    """

    fill: Callable[..., None]
    argument_shapes: tuple[tuple[int, ...], ...]
    result_shapes: tuple[tuple[int, ...], ...]

    def __call__(self, *arguments: np.ndarray) -> tuple[np.ndarray, ...]:
        leading = np.broadcast_shapes(*(a.shape[: a.ndim - len(shape)] for a, shape in zip(arguments, self.argument_shapes, strict=True)))
        results = tuple(np.empty((*leading, *shape)) for shape in self.result_shapes)
        self.fill(*arguments, *results)
        return results


class MotionFunction:
    """(p, rates) -> (q, q̇), p (…, n_p), rates (…, nz) of the independent coordinates, q and q̇ (…, K, n).

    forward: that function; backward: (p, rates, by_q, by_qd) -> (by_p, by_rates), how a number of each motion changes with p and rates,
        from how it does with q and q̇. Both raise as `ncgen.sensitivities` does, NcgenError for one motion of many
    """

    def __init__(self, kernels: Kernels, door: str, grid_of: tuple[float, int], start: dict[str, Any]) -> None:
        """door: what the user calls it; asked: duration (s) and steps; start: other arguments of `ncgen.sensitivities`.

        Raises as that does, and ModelError where p or initial rates are among them.
        """
        if {"p", "zd0", "qd0"} & start.keys():
            raise ModelError(f"{door}: p and the initial rates are the motion's own arguments; leave p, zd0 and qd0 out")
        self.kernels, self._asked, self._start = kernels, grid_of, {name: value for name, value in start.items() if value is not None}
        self._last: tuple[bytes, Motion] | None = None
        self._one(kernels.p0, None)  # so that what cannot be is refused here
        self._z = rates_of(kernels, start)
        start_of_one, rows = ((len(kernels.p0),), (len(self._z),)), ((grid_of[1] + 1, kernels.n),) * 2
        self.forward = ArrayFunction(self._forward, start_of_one, rows)
        self.backward = ArrayFunction(self._backward, (*start_of_one, *rows), start_of_one)

    def checked(self, p: Sequence[int], rates: Sequence[int]) -> None:
        """Raise ModelError for other shapes of arguments of one motion."""
        for name, actual, shape in zip(("p", "rates"), (p, rates), self.forward.argument_shapes, strict=True):
            if tuple(actual) != shape:
                raise ModelError(f"{self.kernels.name}: {name} has shape {tuple(actual)}; it must be {shape}")

    @property
    def _is_for_lanes(self) -> bool:
        """True where many motions run side by side; motions with anything else that was asked for run one after the other."""
        return bool(INTEGRATORS[self._start.get("integrator", "rk4")].tableau) and self._start.keys() <= IN_LANES

    def _forward(self, p: np.ndarray, rates: np.ndarray, q: np.ndarray, qd: np.ndarray) -> None:
        if q.ndim == 2:
            run = self._one(p, rates)
            q[:], qd[:] = run.q, run.qd
        elif not self._is_for_lanes:
            leading = q.shape[:-2]
            arrays = [_spread(p, leading), _spread(rates, leading), q, qd]
            _one_after_the_other(self._forward, leading, arrays)
        else:
            self._completed(self._many(q.shape[:-2], p, rates).sweep(None, rows=(_flat(q, 2), _flat(qd, 2))))

    def _backward(
        self, p: np.ndarray, rates: np.ndarray, by_q: np.ndarray, by_qd: np.ndarray, by_p: np.ndarray, by_rates: np.ndarray
    ) -> None:
        if by_p.ndim == 1:
            derivatives, _ = self._one(p, rates).backward(by_q, by_qd)
        elif not self._is_for_lanes:
            leading = by_p.shape[:-1]
            arrays = [_spread(p, leading), _spread(rates, leading), _spread(by_q, leading, 2), _spread(by_qd, leading, 2)]
            _one_after_the_other(self._backward, leading, [*arrays, by_p, by_rates])
            return
        else:
            leading = by_p.shape[:-1]
            weights = [_flat(_spread(a, leading, 2), 2) for a in (by_q, by_qd)]
            motions = self._many(leading, p, rates)
            derivatives = self._completed(motions.sweep(lambda rows, q, qd: (weights[0][rows], weights[1][rows])))
        by_p[:] = derivatives[..., : p.shape[-1]].reshape(by_p.shape)
        by_rates[:] = derivatives[..., derivatives.shape[-1] - rates.shape[-1] :].reshape(by_rates.shape)

    def _one(self, p: np.ndarray, rates: np.ndarray | None) -> Motion:
        """One motion; the last is kept, since the reverse sweep is asked for through the one that has just been made."""
        key, last = p.tobytes() + (rates.tobytes() if rates is not None else b""), self._last
        if last is None or last[0] != key:
            last = self._last = key, motion_of(self.kernels, *self._asked, p=p, zd0=rates, **self._start)
        return last[1]  # what has been made here, whatever another thread makes meanwhile

    def _many(self, leading: tuple[int, ...], p: np.ndarray, rates: np.ndarray) -> TapedBatch:
        p, rates = (_flat(_spread(a, leading), 1) for a in (p, rates))
        start = {name: value for name, value in self._start.items() if name != "z"}
        return taped_batch(self.kernels, *self._asked, zd0=rates, p=p, z=self._z, **start)

    def _completed(self, swept: Swept) -> np.ndarray:
        """The slopes of many. Raises NcgenError where one did not come to its end."""
        if bad := [i for i, word in enumerate(swept.status) if word != "ok"]:
            raise NcgenError(f"motion {bad[0]} of {len(swept.status)}: {swept.status[bad[0]]}")
        return swept.derivatives


def _one_after_the_other(call: Callable[..., None], leading: tuple[int, ...], arrays: Sequence[np.ndarray]) -> None:
    """Call with the part of every motion of all arrays. Raises NcgenError with the number of the motion."""
    for i, index in enumerate(np.ndindex(leading)):
        try:
            call(*(array[index] for array in arrays))
        except NcgenError as error:
            raise NcgenError(f"motion {i} of {prod(leading)}: {error}") from None


def _spread(array: np.ndarray, leading: tuple[int, ...], axes: int = 1) -> np.ndarray:
    """An array with all leading axes before its own."""
    return np.broadcast_to(array, leading + array.shape[array.ndim - axes :])


def _flat(array: np.ndarray, axes: int) -> np.ndarray:
    """An array with one leading axis before its own, in the same memory where it lies in one piece."""
    shape = array.shape[array.ndim - axes :]
    return array.reshape(prod(array.shape[: array.ndim - axes]), *shape)
