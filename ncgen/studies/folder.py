"""The results of a study on disk: a manifest, and a file of NumPy arrays for every run of variants that is done.

A file is complete from the moment at which it has its name, and its name says which variants it holds, so whatever ends a study, what
is there can be read and the rest is known.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ncgen import __version__
from ncgen.errors import NcgenError
from ncgen.files import locked, write_bytes, write_text
from ncgen.report.along import UNREADABLE as BROKEN
from ncgen.studies.definition import Study
from ncgen.studies.variants import Part

FORMAT = 1
MANIFEST, LOCK = "study.json", ".lock"
NAME = "variants-{:016d}-{:016d}.npz"
FILES = re.compile(r"variants-(\d{16})-(\d{16})\.npz")
UNREADABLE = (*BROKEN, OSError, KeyError)
SAID_OF, SAID = "said_of", "said"
"""Arrays of a file beside the columns: variants of which something was said, and what."""


@dataclass(frozen=True)
class Folder:
    """A folder with a study's manifest: what it says, and the files that hold variants."""

    path: Path
    manifest: dict[str, Any]

    @classmethod
    def of(cls, path: Path, study: Study, made_with: str) -> Folder:
        """The folder of a study, new or to go on with. Raises NcgenError where another study lies in it, or where it cannot be written."""
        there = path / MANIFEST
        if there.exists():
            folder = cls.at(path)
            for what, value, mine in (("study", folder.manifest["study"], study.digest), ("ncgen", folder.manifest["ncgen"], __version__)):
                if value != mine:
                    which = "another study" if what == "study" else f"results of ncgen {value}, not {mine}"
                    raise NcgenError(f"{path}: it holds {which}; give another folder, or remove this one")
            for left in path.glob(".variants-*"):
                left.unlink(missing_ok=True)
            return folder
        if path.exists() and (not path.is_dir() or any(entry.name != LOCK for entry in path.iterdir())):
            raise NcgenError(f"{path}: it is no folder of a study, and not empty; give another folder")
        said = manifest(study, made_with)
        write_text(there, json.dumps(said, indent=1) + "\n")
        return cls(path, said)

    @classmethod
    def at(cls, path: Path) -> Folder:
        """A folder that is there. Raises NcgenError for one of another kind."""
        try:
            said = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
        except OSError as error:
            raise NcgenError(f"{path / MANIFEST}: {error.strerror or error}; give the folder of a study") from error
        except ValueError as error:
            raise NcgenError(f"{path / MANIFEST}: it is no manifest of a study ({error})") from error
        kinds = {"format": int, "study": str, "ncgen": str, "model": str, "variants": int, "design": str, "shape": list, "names": list,
                 "kept": list, "times": list, "made_with": str}  # fmt: skip
        if not isinstance(said, dict) or any(not isinstance(said.get(key), kind) for key, kind in kinds.items()):
            raise NcgenError(f"{path / MANIFEST}: it is no manifest of a study")
        if said["format"] != FORMAT:
            raise NcgenError(f"{path}: it has format {said['format']}; this ncgen reads {FORMAT}")
        return cls(path, said)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns."""
        return (*self.manifest["names"], "ok", *self.manifest["kept"])

    def files(self) -> list[tuple[int, int, Path]]:
        """(first, end, file) of the variants that are done, in order."""
        found = [(int(m[1]), int(m[2]), path) for path in self.path.iterdir() if (m := FILES.fullmatch(path.name))]
        return sorted(found)

    def missing(self) -> list[tuple[int, int]]:
        """(first, end) of the variants that are still to be computed; files that cannot be read are removed."""
        gaps, place = [], 0
        for first, end, path in self.files():
            if not self._is_whole(path, end - first):
                path.unlink()
                continue
            if first > place:
                gaps.append((place, first))
            place = max(place, end)
        return [*gaps, (place, self.manifest["variants"])] if place < self.manifest["variants"] else gaps

    def _is_whole(self, path: Path, count: int) -> bool:
        try:
            return len(self.column(path, "ok")) == count
        except NcgenError:
            return False

    def write(self, part: Part) -> None:
        """Add variants. Raises NcgenError in one line where they cannot be written; what was written before stays."""
        buffer = io.BytesIO()
        said = {SAID_OF: np.array([*part.said], dtype=np.int64), SAID: np.array([*part.said.values()], dtype=str)}
        np.savez(buffer, allow_pickle=False, **part.columns, **said)
        try:
            write_bytes(self.path / NAME.format(part.first, part.first + len(part)), buffer.getvalue())
        except NcgenError as error:
            cause = error.__cause__
            why = getattr(cause, "strerror", None) or str(error)
            raise NcgenError(f"{self.path} takes no more results: {why}; make room and start the study again, it goes on") from error

    def column(self, path: Path, name: str) -> np.ndarray:
        """One column of one file. Raises NcgenError for a file that is broken."""
        try:
            with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
                return archive[name]
        except UNREADABLE as error:
            why = " ".join(str(error).split())
            raise NcgenError(f"{path}: it cannot be read ({why}); start the study again to have it made anew") from error

    def parts(self) -> Iterator[Part]:
        """Everything that is done, a file at a time."""
        for first, _, path in self.files():
            columns = {name: self.column(path, name) for name in self.columns}
            yield Part(first, columns, self.said(path))

    def said(self, path: Path) -> dict[int, str]:
        return dict(zip(self.column(path, SAID_OF).tolist(), self.column(path, SAID).tolist(), strict=True))

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Held by this process alone. Raises NcgenError where another one is at work in it; a process that died holds nothing."""
        with contextlib.ExitStack() as stack:
            try:
                ours = stack.enter_context(locked(self.path / LOCK))
            except OSError as error:
                why = error.strerror or error
                raise NcgenError(f"{self.path / LOCK}: it cannot be locked: {why}; remove it, or give another folder") from error
            if not ours:
                raise NcgenError(f"{self.path}: another process is at work in it; wait for that one, or give another folder")
            yield


def manifest(study: Study, made_with: str) -> dict[str, Any]:
    """What a folder says of its study."""
    return {
        "format": FORMAT, "study": study.digest, "ncgen": __version__, "numpy": np.__version__, "model": study.model.name,
        "variants": study.size, "design": study.design.kind, "shape": list(study.design.shape), "names": list(study.design.names),
        "kept": [column.word for column in study.kept], "times": study.times.tolist(), "made_with": made_with,
    }  # fmt: skip
