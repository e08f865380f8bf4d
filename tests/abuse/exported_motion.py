"""An exported motion in C, as a library of this process."""

from __future__ import annotations

import ctypes
import re
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import ncgen


class Failed(Exception):
    """A function of an export gives another status than 0."""


class Exported:
    """A model's export; `q` and `qd` are where it is. The state of its C holds t, work, power, h, q, qd and qdd."""

    def __init__(self, model: ncgen.Model, kernels: ncgen.Kernels, flags: Sequence[str] = ("-O1",)) -> None:
        self.kernels = kernels
        with tempfile.TemporaryDirectory() as folder:
            ncgen.export(model, "c", folder)
            (header,) = Path(folder, "include").glob("*_motion.h")
            self.prefix = re.sub("_motion$", "", header.stem)
            sources = [str(path) for path in sorted(Path(folder, "src").glob("*.c"))]
            command = ["cc", "-std=c99", *flags, "-ffp-contract=off", "-fPIC", "-shared", f"-I{folder}/include", f"-I{folder}/src"]
            subprocess.run([*command, *sources, "-lm", "-o", f"{folder}/lib.so"], check=True)
            self.library = ctypes.CDLL(f"{folder}/lib.so")

    def begin(self, q: Sequence[float], qd: Sequence[float], p: Sequence[float]) -> None:
        """At t = 0; p: parameters and inputs"""
        n = self.kernels.n
        self.state = (ctypes.c_double * (4 + 3 * n))(0, 0, 0, 0, *map(float, (*q, *qd)))
        self.p = (ctypes.c_double * (len(p) + 1))(*map(float, p))
        self._call("project_state")

    def advance(self, t: float, tolerance: float) -> None:
        self._call("advance", t, tolerance, 0.01 * tolerance)

    def step(self, h: float) -> None:
        self._call("step", h)

    @property
    def q(self) -> list[float]:
        return self.state[4 : 4 + self.kernels.n]

    @property
    def qd(self) -> list[float]:
        return self.state[4 + self.kernels.n : 4 + 2 * self.kernels.n]

    def _call(self, function: str, *numbers: float) -> None:
        status = getattr(self.library, f"{self.prefix}_{function}")(self.state, self.p, *map(ctypes.c_double, numbers))
        if status:
            raise Failed(f"{self.prefix}_{function} in C gives status {status}")
