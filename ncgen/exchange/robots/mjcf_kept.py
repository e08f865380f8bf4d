"""What is read of a compiled model of MuJoCo, kept in the cache under the content of all files that the model is made of.

So a second start neither has MuJoCo compile the file, which takes a second where it has many meshes, nor imports MuJoCo.
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from ncgen.files import opened
from ncgen.toolchain.cache_location import Json, keep, kept

KIND = "mjcf"

MAX_ENTRY_BYTES = 20_000_000
"""Bytes up to which a model is kept: 1,000 bodies with their shapes take one million."""

NOT_KEPT = re.compile(
    r"(bvh|oct|tex|skin|flex|flexvert|flexedge|B|D|M|cam|light)_\w*|hfield_data|map\w+|names_map|geom_fluid|mesh_(?!pos|quat|scale|pathadr)\w*"
)
"""Fields that are large, and that nothing here reads."""

NAME_FIELDS = {
    "body": "body",
    "joint": "jnt",
    "equality": "eq",
    "key": "key",
    "mesh": "mesh",
    "sensor": "sensor",
    "site": "site",
    "actuator": "actuator",
}
"""{method of a model: what the field with the starts of its names is called by}."""

MESSAGES = "messages"
"""What MuJoCo warned of."""


class KeptModel(SimpleNamespace):
    """What was kept, with the fields of MuJoCo's model that are arrays, numbers and bytes, its options, and `body(i).name` and so on."""

    def __getattr__(self, name: str) -> Callable[[int], Any]:
        if name not in NAME_FIELDS:
            raise AttributeError(name)
        starts = getattr(self, f"name_{NAME_FIELDS[name]}adr")
        return lambda number: SimpleNamespace(name=self._text(int(starts[number])))

    def _text(self, start: int) -> str:
        return self.names[start : self.names.index(b"\0", start)].decode()


def key_of(path: Path, library: Path, text: str | None, files: Iterable[str]) -> str:
    """What the model of a file is kept under. text: in place of the file's own; files: all that it is made of"""
    state = library.stat()
    words = [str(path.absolute()), str(library), str(state.st_size), str(state.st_mtime_ns), _content(__file__), text or ""]
    for file in sorted(files):
        words += [file, _content(file)]
    return hashlib.sha256("\0".join(words).encode(errors="surrogatepass")).hexdigest()[:40]


def _content(file: str) -> str:
    """The digest of a file."""
    digest = hashlib.sha256()
    with opened(file) as content:
        while block := content.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def kept_model(key: str) -> tuple[KeptModel, list[str]] | None:
    """The model that was kept under a key, and what MuJoCo warned of; None if there is none."""
    entry = kept(KIND, key)
    if entry is None:
        return None
    options = KeptModel(**_restored(entry["options"]))
    return KeptModel(opt=options, **_restored(entry["fields"])), entry[MESSAGES]


def keep_model(key: str, model: Any, messages: list[str], files: Iterable[str]) -> None:
    """Keep what is read of a model, unless it names a file that is not among files, whose change would not be seen."""
    known = {os.path.basename(file) for file in files}
    named = (re.split(r"[/\\]", name.decode(errors="replace"))[-1] for name in model.paths.split(b"\0") if name)
    if known.issuperset(named):
        entry: Json = {"fields": _plain(model), "options": _plain(model.opt), MESSAGES: messages}
        keep(KIND, key, entry, MAX_ENTRY_BYTES)


def _plain(owner: Any) -> dict[str, Json]:
    """Fields as JSON can say them: arrays and bytes as text, in base 64."""
    plain: dict[str, Json] = {}
    for name in dir(owner):
        value = None if name.startswith("_") or NOT_KEPT.fullmatch(name) else getattr(owner, name)
        if isinstance(value, np.ndarray):
            plain[name] = [_text_of(np.ascontiguousarray(value).tobytes()), value.dtype.str, list(value.shape)]
        elif isinstance(value, bytes):
            plain[name] = [_text_of(value)]
        elif isinstance(value, (bool, int, float)):
            plain[name] = value
    return plain


def _text_of(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _restored(fields: Mapping[str, Any]) -> dict[str, Any]:
    """What `_plain` made plain."""
    return {name: value if isinstance(value, (bool, int, float)) else _value(*value) for name, value in fields.items()}


def _value(text: str, dtype: str = "", shape: Iterable[int] = ()) -> bytes | np.ndarray:
    data = base64.b64decode(text)
    return np.frombuffer(data, np.dtype(dtype)).reshape(tuple(shape)) if dtype else data
