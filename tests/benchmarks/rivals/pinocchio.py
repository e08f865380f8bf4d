"""Pinocchio's articulated-body algorithm for open trees of hinges: from C++, in the loop in C that all are timed in, and from Python.

Needs `pin` and, for the headers that it is compiled with, `cmeel-eigen`.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import numpy as np

from benchmarks.rivals.articulated import Joint
from ncgen.errors import NcgenError
from ncgen.report.repeat import KernelCall
from ncgen.toolchain.abi import abi
from ncgen.toolchain.cache import BuiltLibrary, compiled
from ncgen.toolchain.loader import opened

SOURCE = Path(__file__).with_suffix(".cpp")

# Pinocchio's own definitions; no -march: the library is compiled without, and Eigen's alignment must be the same.
FLAGS = (
    "-x", "c++", "-std=c++17", "-O2", "-DNDEBUG", "-w", "-fPIC", "-shared", "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION",
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
)  # fmt: skip

PATIENCE = 1800.0
"""Seconds that the compiler may take for its headers: two minutes where nothing else runs."""


def installed() -> Path:
    """The folder of Pinocchio's library and of its headers. Raises ImportError or StopIteration where one is missing."""
    prefix = next(p for p in Path(import_module("pinocchio").__file__ or "").parents if p.name == "cmeel.prefix")
    if not (prefix / "include" / "eigen3").is_dir():
        raise ModuleNotFoundError("cmeel-eigen is not installed")
    return prefix


def compiled_cpp(source: Path, flags: tuple[str, ...]) -> BuiltLibrary:
    """A source in C++ with Pinocchio's library. Raises as `installed` does, and NcgenError where a compiler is missing."""
    prefix = installed()
    libraries = ("-x", "none", f"-L{prefix}/lib", f"-Wl,-rpath,{prefix}/lib", "-lpinocchio_default", "-lstdc++", "-lm")
    included = (f"-I{prefix}/include", f"-I{prefix}/include/eigen3")
    return compiled({"pinocchio.c": source.read_text(encoding="utf-8")}, (*flags, *included), libraries, PATIENCE)


def in_cpp(joints: Sequence[Joint], places: Sequence[int], gravity: Sequence[float]) -> KernelCall | None:
    """The accelerations of the angles as a function (t, q, rates, p); None where Pinocchio or its headers are not installed.

    places: of the angles in q. The library knows one mechanism at a time: what was made before is no longer to be called.
    """
    try:
        built = compiled_cpp(SOURCE, FLAGS)
    except (ImportError, NcgenError, StopIteration):
        return None
    made = "void pinocchio_make(int, const int *, const int *, const int *, const double *, const double *);"
    ffi, library = opened(built.library, f"{made} ncgen_velocity_kernel pinocchio_gamma;", abi())
    whole = [[-1 if j.parent is None else j.parent for j in joints], [places[j.rate] for j in joints], [j.rate for j in joints]]
    numbers = [x for j in joints for x in (j.sign, *j.rotation.flat, *j.offset, j.mass, *j.centre, *j.inertia.flat)]
    library.pinocchio_make(len(joints), *(ffi.new("int[]", values) for values in whole), ffi.new("double[]", numbers), list(gravity))
    return KernelCall(ffi.addressof(library, "pinocchio_gamma"), len(joints), (ffi, library))


class InPython:
    """The same as it is called from Python: `pinocchio.aba`. Raises ImportError where it is not installed."""

    def __init__(self, joints: Sequence[Joint], gravity: Sequence[float]) -> None:
        self.pinocchio = pin = import_module("pinocchio")
        self.model, self.joints = pin.Model(), joints
        self.model.gravity.linear = np.array(gravity)
        for number, j in enumerate(joints):
            place = pin.SE3(j.rotation, j.offset)
            made = self.model.addJoint(0 if j.parent is None else j.parent + 1, pin.JointModelRZ(), place, f"joint{number}")
            self.model.appendBodyToJoint(made, pin.Inertia(j.mass, j.centre, j.inertia), pin.SE3.Identity())
        self.data, self.none = self.model.createData(), np.zeros(len(joints))

    def at(self, angles: np.ndarray, rates: np.ndarray) -> None:
        """Where it is called."""
        self.q, self.v = (np.array([j.sign * values[j.rate] for j in self.joints]) for values in (angles, rates))

    def __call__(self) -> object:
        return self.pinocchio.aba(self.model, self.data, self.q, self.v, self.none)

    def accelerations(self) -> np.ndarray:
        found = np.empty(len(self.joints))
        for j, value in zip(self.joints, np.array(self.data.ddq), strict=True):
            found[j.rate] = j.sign * value
        return found
