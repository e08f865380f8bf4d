"""A motion as a function of its parameters and initial rates, of one or many of them at a time, with the way back: what libraries that
differentiate call, in NumPy's arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from threading import local
from typing import Any

import numpy as np

from ncgen.errors import ModelError, NcgenError
from ncgen.mechanism.kernels import Kernels
from ncgen.model.elements import coordinate_of
from ncgen.solver.derivatives.gradients import taped_batch
from ncgen.solver.derivatives.sensitivity import Motion, motion_of
from ncgen.solver.derivatives.taped_batch import TapedBatch


def rates_of(kernels: Kernels, start: dict[str, Any]) -> tuple[str, ...]:
    """The independent coordinates whose rates a motion takes; start: as of `ncgen.sensitivities`."""
    names = motion_of(kernels, 1e-9, 1, "rk4", **start).names
    return tuple(coordinate for name in names if (coordinate := coordinate_of(name)) != name)


class MotionFunction:
    """(p, rates) -> (q, q̇), p (…, n_p), rates (…, nz) of the independent coordinates, q and q̇ (…, K, n).

    shapes: of p and of rates of one motion, and of its q
    """

    def __init__(self, kernels: Kernels, door: str, asked: tuple[float, int, str], start: dict[str, Any]) -> None:
        """door: what the user calls it; asked: duration (s), steps and integrator; start: other arguments of `ncgen.sensitivities`.

        Raises as that does, and ModelError where p or initial rates are among them.
        """
        if {"p", "zd0", "qd0"} & start.keys():
            raise ModelError(f"{door}: p and the initial rates are the motion's own arguments; leave p, zd0 and qd0 out")
        self.kernels, self._asked, self._start = kernels, asked, start
        self._kept = local()
        self._last: tuple[bytes, Motion] | None = None
        self._one(kernels.p0, None)  # so that what cannot be is refused here
        self._z = rates_of(kernels, start)
        self.shapes = (len(kernels.p0),), (len(self._z),), (asked[1] + 1, kernels.n)

    def checked(self, p: Sequence[int], rates: Sequence[int]) -> None:
        """Raise ModelError for other shapes of arguments of one motion."""
        for name, found, shape in (("p", p, self.shapes[0]), ("rates", rates, self.shapes[1])):
            if tuple(found) != shape:
                raise ModelError(f"{self.kernels.name}: {name} has shape {tuple(found)}; it must be {shape}")

    def forward(self, p: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """q and q̇; of many motions in memory that the next call of the same thread writes to.

        Raises as `ncgen.sensitivities` does, NcgenError for one motion of many.
        """
        if p.ndim == 1:
            run = self._one(p, rates)
            return run.q, run.qd
        leading = p.shape[:-1]
        batch = self._many(p, rates)
        rows = self._room((2, len(batch.states.q), *self.shapes[2]))
        self._completed(batch.sweep(None, rows=rows).status)
        q, qd = rows.reshape(2, *leading, *self.shapes[2])
        return q, qd

    def backward(self, p: np.ndarray, rates: np.ndarray, by_q: np.ndarray, by_qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How a number of each motion changes with p and rates, from how it does with q and q̇."""
        if p.ndim == 1:
            slopes, _ = self._one(p, rates).backward(by_q, by_qd)
        else:
            flat = [a.reshape(-1, *self.shapes[2]) for a in (by_q, by_qd)]
            found = self._many(p, rates).sweep(lambda rows, q, qd: (flat[0][rows], flat[1][rows]))
            self._completed(found.status)
            slopes = found.slopes.reshape(*p.shape[:-1], -1)
        return slopes[..., : len(self.kernels.p0)], slopes[..., slopes.shape[-1] - len(self._z) :]

    def _one(self, p: np.ndarray, rates: np.ndarray | None) -> Motion:
        """One motion; the last is kept, since the way back is asked for through the one that has just been made."""
        key = p.tobytes() + (rates.tobytes() if rates is not None else b"")
        if self._last is None or self._last[0] != key:
            self._last = key, motion_of(self.kernels, *self._asked, p=p, zd0=rates, **self._start)
        return self._last[1]

    def _many(self, p: np.ndarray, rates: np.ndarray) -> TapedBatch:
        count = int(np.prod(p.shape[:-1]))
        flat = [a.reshape(count, a.shape[-1]) for a in (p, rates)]
        given = {name: value for name, value in self._start.items() if name in ("q0", "t0")}
        return taped_batch(self.kernels, *self._asked, zd0=flat[1], p=flat[0], z=self._z, **given)

    def _room(self, shape: tuple[int, ...]) -> np.ndarray:
        """Memory that has been used before where there is some: the system takes as long to give new memory as a copy takes."""
        kept = getattr(self._kept, "rows", None)
        if kept is None or kept.shape != shape:
            kept = self._kept.rows = np.empty(shape)
        return kept

    def _completed(self, status: list[str]) -> None:
        """Raise NcgenError where one of many did not come to its end."""
        if bad := [i for i, word in enumerate(status) if word != "ok"]:
            raise NcgenError(f"motion {bad[0]} of {len(status)}: {status[bad[0]]}")
