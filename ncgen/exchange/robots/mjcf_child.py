"""A program of its own: MuJoCo's C library compiles one MJCF file, within limits. It imports neither ncgen nor MuJoCo's Python package.

python -I -S mjcf_child.py LIBRARY PLUGINS FILE FOLDER SECONDS writes FOLDER/model.mjb, and FOLDER/told.json with "error" or "warnings".
FOLDER/unread.json names files that only looks depend on, [[path, columns, rows]]: MuJoCo takes plain pictures of so many dots, and small
solids, for them.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import struct
import sys
from typing import NoReturn

MEMORY = 4 << 30
"""Bytes of addresses that the process may have: a small machine's memory, and 400 times what it begins with."""

MAX_MODEL_BYTES = 1 << 30
"""Bytes of the compiled model."""

UNREAD_FILES = "unread.json"

PLAIN_MESHES = (".obj", ".stl")
"""What the names of meshes end with that a small solid can stand for."""

CORNERS, FACES = ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)), ((0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2))
"""Of such a solid, a tetrahedron."""

MAX_VFS_BYTES = 1 << 14
"""Bytes of a virtual file system, which is a pointer in MuJoCo 3.2 and later."""

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
    unread = _unread(os.path.join(folder, UNREAD_FILES))
    model = unread and mujoco.mj_loadXML(os.fsencode(file), _plain_files(mujoco, unread), problem, len(problem))
    if not model:  # without such files, or they do not suit
        warnings.clear()
        model = mujoco.mj_loadXML(os.fsencode(file), None, problem, len(problem))
    if not model:
        finish(_text(problem.value) or "MuJoCo does not say why", 1)
    mujoco.mj_saveModel(model, os.fsencode(os.path.join(folder, "model.mjb")), None, 0)
    finish("", 0)


def _unread(path: str) -> list[tuple[str, int, int]]:
    """Files, and how many dots wide and high they are as pictures; none where there is no such file."""
    try:
        with open(path, encoding="utf-8") as file:
            return json.load(file)
    except FileNotFoundError:
        return []


def _plain_files(mujoco: ctypes.CDLL, unread: list[tuple[str, int, int]]) -> ctypes.Array[ctypes.c_char]:
    """MuJoCo's virtual file system with plain files in the place of others: reading these would take longer than all else."""
    mujoco.mj_addBufferVFS.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_int]
    files = ctypes.create_string_buffer(MAX_VFS_BYTES)
    mujoco.mj_defaultVFS(files)
    for name, columns, rows in unread:
        plain = _picture(columns, rows) if columns else _solid(name.lower().endswith(".obj"))
        mujoco.mj_addBufferVFS(files, os.fsencode(name), plain, len(plain))
    return files


def _picture(columns: int, rows: int) -> bytes:
    """A black picture (PNG)."""
    import zlib

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0))
    dots = chunk(b"IDAT", zlib.compress((b"\0" + bytes(3 * columns)) * rows))
    return b"\x89PNG\r\n\x1a\n" + header + dots + chunk(b"IEND", b"")


def _solid(is_obj: bool) -> bytes:
    """A mesh of few triangles (OBJ, or binary STL)."""
    if is_obj:
        return b"".join([b"v %d %d %d\n" % each for each in CORNERS] + [b"f %d %d %d\n" % (a + 1, b + 1, c + 1) for a, b, c in FACES])
    triangles = [struct.pack("<12fH", 0, 0, 0, *CORNERS[a], *CORNERS[b], *CORNERS[c], 0) for a, b, c in FACES]
    return bytes(80) + struct.pack("<I", len(FACES)) + b"".join(triangles)


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
