"""NumPy archives (.npz) as data: every member is read to its last byte, so that its checksum is looked at, and nothing is unpickled."""

from __future__ import annotations

import io
import lzma
import math
import os
import struct
import zipfile
import zlib
from collections.abc import Collection, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from ncgen.files import opened

MOST_TIMES = 100
"""An archive that unpacks to more than so many times its size is none of ours, which are not packed."""

UNREADABLE_ERRORS = (
    ValueError, EOFError, MemoryError, OverflowError, RecursionError, KeyError, RuntimeError, NotImplementedError, struct.error,
    zipfile.BadZipFile, zlib.error, lzma.LZMAError,
)  # fmt: skip
"""What Python raises for a file that is no archive, or a broken or encrypted one."""

MEMBER = ".npy"


def arrays(path: Path, names: Collection[str] | None = None, former: Mapping[str, str] = MappingProxyType({})) -> dict[str, np.ndarray]:
    """Read the arrays of an archive.

    names: those that are wanted if they are there; None for all; former: {name in archives of before: name today}
    Raises OSError for what is no ordinary file, and ValueError, in words, for what is no archive, or not whole.
    """
    with opened(path) as file:
        try:
            with zipfile.ZipFile(file) as archive:
                members = archive.infolist()
                if sum(member.file_size for member in members) > MOST_TIMES * os.fstat(file.fileno()).st_size:
                    raise ValueError("an archive that unpacks to far more than it is")
                listed = [(member.filename.removesuffix(MEMBER), member) for member in members if member.filename.endswith(MEMBER)]
                stored = {former.get(name, name): member for name, member in listed}
                if len(stored) < len(members):
                    raise ValueError("a member is no array, or there twice")
                wanted = [name for name in stored if names is None or name in names]
                return {name: _array(archive.read(stored[name]), name) for name in wanted}
        except UNREADABLE_ERRORS as error:
            raise ValueError(" ".join(str(error).split()) or type(error).__name__) from error


def packed(members: Mapping[str, np.ndarray]) -> bytes:
    """An archive of arrays with any names, as bytes; the same arrays give the same bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, array in members.items():
            with archive.open(zipfile.ZipInfo(f"{name}{MEMBER}"), "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
    return buffer.getvalue()


def _array(data: bytes, name: str) -> np.ndarray:
    """The array of a member. Raises ValueError unless it is as long as it says."""
    if not data.startswith(np.lib.format.MAGIC_PREFIX):
        raise ValueError(f"{name} is no array")
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    if version not in ((1, 0), (2, 0)):
        raise ValueError(f"{name} has format {version[0]}.{version[1]}")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, by_columns, dtype = read(stream)
    if dtype.hasobject or dtype.names:
        raise ValueError(f"{name} is made of {dtype}, and not of numbers or texts")
    if math.prod(shape) * dtype.itemsize != len(data) - stream.tell():
        raise ValueError(f"{name} is not as long as it says")
    return np.frombuffer(data, dtype, offset=stream.tell()).reshape(shape, order="F" if by_columns else "C").copy()
