"""A program of its own: MuJoCo's C library compiles one MJCF file, within limits. It imports neither ncgen nor MuJoCo's Python package.

python -I -S mjcf_child.py LIBRARY PLUGINS FILE FOLDER SECONDS writes FOLDER/model.mjb, and FOLDER/told.json with "error" or "warnings".
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import sys
from typing import NoReturn

MEMORY = 4 << 30
"""Bytes of addresses that the process may have: a small machine's memory, and 400 times what it begins with."""

MAX_MODEL_BYTES = 1 << 30
"""Bytes of the compiled model."""

MOST_TOLD = 20
"""Warnings that are passed on."""


def main(library: str, plugins: str, file: str, folder: str, seconds: int) -> NoReturn:
    _limit(seconds)
    warnings: list[str] = []

    def finish(error: str, status: int) -> NoReturn:
        with open(os.path.join(folder, "told.json"), "w", encoding="ascii") as result:
            json.dump({"error": error, "warnings": warnings[:MOST_TOLD]}, result)
        os._exit(status)

    mujoco, callback_type = ctypes.CDLL(library), ctypes.CFUNCTYPE(None, ctypes.c_char_p)
    warned = callback_type(lambda text: warnings.append(_text(text)) if len(warnings) < MOST_TOLD else None)
    failed = callback_type(lambda text: finish(_text(text), 1))  # MuJoCo does not expect this one to return
    for name, function in (("mju_user_warning", warned), ("mju_user_error", failed)):
        ctypes.c_void_p.in_dll(mujoco, name).value = ctypes.cast(function, ctypes.c_void_p).value
    mujoco.mj_loadXML.restype = ctypes.c_void_p
    mujoco.mj_loadXML.argtypes = [ctypes.c_char_p, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int]
    mujoco.mj_saveModel.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int64]
    if plugins:
        mujoco.mj_loadAllPluginLibraries(os.fsencode(plugins), None)
    problem = ctypes.create_string_buffer(2000)
    model = mujoco.mj_loadXML(os.fsencode(file), None, problem, len(problem))
    if not model:
        finish(_text(problem.value) or "MuJoCo does not say why", 1)
    mujoco.mj_saveModel(model, os.fsencode(os.path.join(folder, "model.mjb")), None, 0)
    finish("", 0)


def _limit(seconds: int) -> None:
    """Bound processor time, memory and what is written, where the system has such limits; a crash leaves no image of the memory."""
    try:
        import resource
    except ImportError:  # Windows: the one who waits ends it
        return
    limits = (
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_AS, MEMORY),
        (resource.RLIMIT_FSIZE, MAX_MODEL_BYTES),
        (resource.RLIMIT_CORE, 0),
    )
    for resource_kind, most in limits:
        hard = resource.getrlimit(resource_kind)[1]
        with contextlib.suppress(ValueError, OSError):  # macOS does not take all of them
            resource.setrlimit(resource_kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _text(message: bytes | None) -> str:
    return " ".join((message or b"").decode(errors="replace").split())


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4], int(sys.argv[5]))
