"""MuJoCo (https://mujoco.org) for open trees of hinges: mj_forward from C, in the loop that all are timed in, and from Python."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import numpy as np

from benchmarks.rivals.articulated import Joint
from ncgen.errors import NcgenError
from ncgen.report.repeat import KernelCall
from ncgen.toolchain.abi import abi
from ncgen.toolchain.cache import compiled
from ncgen.toolchain.compilers import FLAGS
from ncgen.toolchain.loader import opened

SOURCE = Path(__file__).with_suffix(".c")


class InPython:
    """mj_forward from Python. Raises ImportError where MuJoCo is not installed."""

    def __init__(self, joints: Sequence[Joint], gravity: Sequence[float]) -> None:
        self.mujoco, self.joints = import_module("mujoco"), joints
        self.model = self.mujoco.MjModel.from_xml_string(_xml(joints, gravity))
        self.data = self.mujoco.MjData(self.model)
        names = [self.model.joint(i).name for i in range(self.model.nv)]
        self.order = [joints[int(name[1:])] for name in names]

    def at(self, angles: np.ndarray, rates: np.ndarray) -> None:
        """Where it is called."""
        self.data.qpos[:] = [j.sign * angles[j.rate] for j in self.order]
        self.data.qvel[:] = [j.sign * rates[j.rate] for j in self.order]

    def __call__(self) -> object:
        return self.mujoco.mj_forward(self.model, self.data)

    def accelerations(self) -> np.ndarray:
        found = np.empty(len(self.order))
        for j, value in zip(self.order, self.data.qacc, strict=True):
            found[j.rate] = j.sign * value
        return found

    def in_c(self, places: Sequence[int]) -> KernelCall | None:
        """The accelerations of the angles as a function (t, q, rates, p); places: of the angles in q. None where it is not compiled.

        The library knows one mechanism at a time: what was made before is no longer to be called.
        """
        home = Path(str(self.mujoco.__file__)).parent
        found = sorted(home.glob("libmujoco.so*"))
        if not found:
            return None
        try:
            files = {"mujoco.c": SOURCE.read_text(encoding="utf-8")}
            built = compiled(files, (*FLAGS, f"-I{home}/include"), (str(found[0]), f"-Wl,-rpath,{home}", "-lm"))
        except NcgenError:
            return None
        made = "void mujoco_make(unsigned long long, unsigned long long, const int *, const int *, const double *);"
        ffi, library = opened(built.library, f"{made} ncgen_velocity_kernel mujoco_gamma;", abi())
        at, rates, signs = [places[j.rate] for j in self.order], [j.rate for j in self.order], [j.sign for j in self.order]
        library.mujoco_make(self.model._address, self.data._address, at, rates, signs)
        return KernelCall(ffi.addressof(library, "mujoco_gamma"), len(at), (ffi, library, self))


def _xml(joints: Sequence[Joint], gravity: Sequence[float]) -> str:
    """The tree as MJCF."""
    children: dict[int | None, list[int]] = {}
    for number, joint in enumerate(joints):
        children.setdefault(joint.parent, []).append(number)

    def body(number: int) -> str:
        j = joints[number]
        inertia = [j.inertia[a] for a in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        axes = [*j.rotation[:, 0], *j.rotation[:, 1]]
        inertial = f'<inertial pos="{_numbers(j.centre)}" mass="{float(j.mass)!r}" fullinertia="{_numbers(inertia)}"/>'
        inside = "".join(map(body, children.get(number, [])))
        hinge = f'<joint name="j{number}" type="hinge" axis="0 0 1"/>'
        return f'<body pos="{_numbers(j.offset)}" xyaxes="{_numbers(axes)}">{inertial}{hinge}{inside}</body>'

    head = f'<compiler angle="radian"/><option gravity="{_numbers(gravity)}"/>'
    return f"<mujoco>{head}<worldbody>{''.join(map(body, children[None]))}</worldbody></mujoco>"


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(repr(float(x)) for x in values)
