"""The results of a study on disk: a manifest, and a file of NumPy arrays for every run of variants that is done.

A file has its name from the moment at which it is whole, and its name says which variants it holds, so whatever ends a study, what is
there can be read and the rest is known. What happens to files later is seen: one counts only if every column is there, as long as it
should be and with its checksum.
"""

from __future__ import annotations

import contextlib
import json
import re
import sys
import warnings
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ncgen import __version__
from ncgen.archives import arrays, packed
from ncgen.errors import NcgenError, shown
from ncgen.files import contents, is_folder, is_there, locked, write_bytes, write_text
from ncgen.studies.definition import Study
from ncgen.studies.variants import Part

FORMAT = 1
MANIFEST, LOCK = "study.json", ".lock"
NAME = "variants-{:016d}-{:016d}.npz"
FILES = re.compile(r"variants-(\d{16})-(\d{16})\.npz")
UNFINISHED = ".variants-*"
MESSAGE_VARIANTS, MESSAGES = "message variants", "message texts"
"""Arrays of a file next to the columns: variants with messages, and these. (No column has a blank in a name like these.)"""

FORMER = {"said of": MESSAGE_VARIANTS, "what was said": MESSAGES}
"""{array in files of before: its name today}."""

MAX_VARIANTS = 10**16 - 1
"""Variants of a study, as the names of files can say."""

MAX_MANIFEST_BYTES = 200_000_000
"""Bytes of a manifest, which has all times of histories."""

KINDS: dict[str, type] = {
    "format": int, "study": str, "ncgen": str, "model": str, "variants": int, "design": str, "shape": list, "names": list, "kept": list,
    "times": list, "made_with": str,
}  # fmt: skip
"""{entry of a manifest: what it is}."""

ENTRIES: dict[str, tuple[type, ...]] = {"shape": (int,), "names": (str,), "kept": (str,), "times": (int, float)}
"""{entry that is a list: what is in it}."""

MAY_DIFFER = ("numpy", "made_with")
"""Entries in which another machine may differ: what they say is told and not used."""


@dataclass(frozen=True)
class Folder:
    """A folder with a study's manifest: what it says, and the files that hold variants."""

    path: Path
    manifest: dict[str, Any]

    @classmethod
    def of(cls, path: Path, study: Study, made_with: str) -> Folder:
        """The folder of a study, new or to go on with. Raises NcgenError where another study lies in it, or where it cannot be written."""
        expected = manifest(study, made_with)
        if is_there(path / MANIFEST):
            folder = cls.at(path)
            folder._check(expected)
            return folder
        try:
            strange = is_there(path) and (not is_folder(path) or any(entry.name != LOCK for entry in path.iterdir()))
        except OSError as error:
            raise NcgenError(f"{path}: {error.strerror or error}; give another folder") from error
        if strange:
            raise NcgenError(f"{path}: it is no folder of a study, and not empty; give another folder")
        write_text(path / MANIFEST, json.dumps(expected, indent=1) + "\n")
        return cls(path, expected)

    @classmethod
    def at(cls, path: Path) -> Folder:
        """A folder that is there. Raises NcgenError for one of another kind."""
        try:
            manifest = json.loads(contents(path / MANIFEST, MAX_MANIFEST_BYTES))
        except OSError as error:
            raise NcgenError(f"{path / MANIFEST}: {error.strerror or error}; give the folder of a study") from error
        except (ValueError, RecursionError) as error:
            raise _no_manifest(path, str(error)) from error
        if problem := _fault_of(manifest):
            raise _no_manifest(path, problem)
        if manifest["format"] != FORMAT:
            raise NcgenError(f"{path}: it has format {shown(manifest['format'])}; this ncgen reads {FORMAT}")
        return cls(path, manifest)

    def _check(self, expected: Mapping[str, Any]) -> None:
        """Raise NcgenError unless the folder's manifest is that of a study."""
        for key, value in expected.items():
            if key in MAY_DIFFER or (present := self.manifest.get(key)) == value:
                continue
            problems = {"study": "another study", "ncgen": f"results of ncgen {shown(present)[1:-1]}, not {value}"}
            which = problems.get(key, f"a manifest in which {key} is {shown(present)} instead of {shown(value)}")
            raise NcgenError(f"{self.path}: it holds {which}; give another folder, or remove this one")

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns."""
        return (*self.manifest["names"], "ok", *self.manifest["kept"])

    def files(self) -> list[tuple[int, int, Path]]:
        """(first, end, file) of the variants that are done, in order. Raises NcgenError where two files hold the same variants."""
        listed, position = self._listed(), 0
        for first, end, path in listed:
            if why := self._misplaced(first, end, position):
                raise NcgenError(f"{path}: {why}; start the study again, which removes it")
            position = end
        return listed

    def missing(self) -> list[tuple[int, int]]:
        """(first, end) of the variants that are still to be computed.

        Files that are not whole, which is reported in one line, and those that a killed process left are removed: the folder must be held.
        """
        for path in self.path.glob(UNFINISHED):
            _remove(path)
        gaps, position, broken = list[tuple[int, int]](), 0, list[str]()
        for first, end, path in self._listed():
            if why := self._misplaced(first, end, position) or self._fault(path):
                broken.append(f"{path.name} ({why})")
                _remove(path)
                continue
            if first > position:
                gaps.append((position, first))
            position = end
        if broken:
            count = f"{len(broken)} files are not whole, the first is" if len(broken) > 1 else "a file is not whole,"
            warnings.warn(f"{self.path}: {count} {broken[0]}; what they should hold is computed again", stacklevel=2)
        return [*gaps, (position, self.manifest["variants"])] if position < self.manifest["variants"] else gaps

    def is_whole(self) -> bool:
        """Whether every file that is there is whole; reads all of them."""
        return not any(self._fault(path) for _, _, path in self.files())

    def write(self, block: Part) -> None:
        """Add variants. Raises NcgenError in one line where they cannot be written; what was written before stays."""
        messages = {
            MESSAGE_VARIANTS: np.array([*block.messages], dtype=np.int64),
            MESSAGES: np.array([*block.messages.values()], dtype=str),
        }
        try:
            write_bytes(self.path / NAME.format(block.first, block.first + len(block)), packed(block.columns | messages))
        except NcgenError as error:
            cause = error.__cause__
            why = getattr(cause, "strerror", None) or str(error)
            raise NcgenError(f"{self.path} takes no more results: {why}; make room and start the study again, it resumes") from error

    def column(self, path: Path, name: str) -> np.ndarray:
        """One column of one file. Raises NcgenError for a file that is broken."""
        return self._read(path, (name,))[name]

    def parts(self) -> Iterator[Part]:
        """Everything that is done, a file at a time."""
        for first, _, path in self.files():
            yield self.part(first, path)

    def part(self, first: int, path: Path) -> Part:
        """The variants of one file. Raises NcgenError for a file that is broken."""
        columns = self._read(path, (*self.columns, MESSAGE_VARIANTS, MESSAGES))
        return Part(first, {name: columns[name] for name in self.columns}, _messages_in(columns))

    def messages(self, path: Path) -> dict[int, str]:
        """{variant: sentence} of one file. Raises NcgenError for a file that is broken."""
        return _messages_in(self._read(path, (MESSAGE_VARIANTS, MESSAGES)))

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

    # -- what is in a file -----------------------------------------------------------------------------------------------------------------

    def _listed(self) -> list[tuple[int, int, Path]]:
        try:
            return sorted((int(m[1]), int(m[2]), path) for path in self.path.iterdir() if (m := FILES.fullmatch(path.name)))
        except OSError as error:
            raise NcgenError(f"{self.path}: {error.strerror or error}; give the folder of a study") from error

    def _misplaced(self, first: int, end: int, position: int) -> str:
        """Why a file is not one that holds variants behind `position`, in words; "" if it is."""
        if not first < end <= self.manifest["variants"]:
            return f"there are no such variants among {self.manifest['variants']}"
        return "another file has some of its variants" if first < position else ""

    def _fault(self, path: Path) -> str:
        """Why a file is not whole, in words; "" if it is."""
        try:
            self._arrays(path, None)
        except (OSError, ValueError) as error:
            return getattr(error, "strerror", None) or str(error)
        return ""

    def _read(self, path: Path, names: Collection[str]) -> dict[str, np.ndarray]:
        try:
            return self._arrays(path, names)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or str(error)
            raise NcgenError(f"{path}: it cannot be read ({why}); start the study again to have it made anew") from error

    def _arrays(self, path: Path, names: Collection[str] | None) -> dict[str, np.ndarray]:
        """Columns of a file, None for all, whose checksums and lengths are right. Raises OSError, or ValueError in words."""
        columns = arrays(path, names, FORMER)
        name = FILES.fullmatch(path.name)
        count = int(name[2]) - int(name[1]) if name else 0
        for column in (*self.columns, MESSAGE_VARIANTS, MESSAGES) if names is None else names:
            if column not in columns:
                raise ValueError(f"it has no {column}")
            if column in (MESSAGE_VARIANTS, MESSAGES):
                if columns[column].ndim != 1 or columns[column].dtype.kind != ("i" if column == MESSAGE_VARIANTS else "U"):
                    raise ValueError(f"{column} is no list")
                continue
            shape = (count, len(self.manifest["times"])) if column.startswith("history(") and column in self.manifest["kept"] else (count,)
            if columns[column].shape != shape or columns[column].dtype.kind not in ("b" if column == "ok" else "if"):
                raise ValueError(f"{column} has {columns[column].dtype} of shape {columns[column].shape}, not {shape}")
        if {MESSAGE_VARIANTS, MESSAGES} <= columns.keys() and len(columns[MESSAGE_VARIANTS]) != len(columns[MESSAGES]):
            raise ValueError(f"{MESSAGES} and {MESSAGE_VARIANTS} have different lengths")
        return columns


def _messages_in(columns: Mapping[str, np.ndarray]) -> dict[int, str]:
    return dict(zip(columns[MESSAGE_VARIANTS].tolist(), columns[MESSAGES].tolist(), strict=True))


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise NcgenError(f"{path}: it cannot be removed: {error.strerror or error}; remove it yourself, or give another folder") from error


def _no_manifest(path: Path, problem: str) -> NcgenError:
    return NcgenError(f"{path / MANIFEST}: it is no manifest of a study ({problem})")


def _fault_of(manifest: Any) -> str:
    """What is wrong with a manifest, in words; "" if nothing is."""
    if not isinstance(manifest, dict):
        return "no table"
    for key, kind in KINDS.items():
        value = manifest.get(key)
        if type(value) is not kind:
            return f"{key} is {shown(value)}"
        if isinstance(value, list) and not all(type(item) in ENTRIES[key] for item in value):
            return f"{key} has something else than {' or '.join(kind.__name__ for kind in ENTRIES[key])} in it"
    size = 1
    for count in manifest["shape"]:
        size *= count
        if not 0 <= size <= MAX_VARIANTS:
            break
    if size != manifest["variants"] or not 0 <= size <= MAX_VARIANTS:
        return f"{shown(manifest['variants'])} variants of shape {shown(manifest['shape'])}"
    if len({*manifest["names"], "ok", *manifest["kept"]}) < len(manifest["names"]) + 1 + len(manifest["kept"]):
        return "two columns have one name"
    if not all(-sys.float_info.max <= time <= sys.float_info.max for time in manifest["times"]):
        return "a time is not finite"
    return ""


def manifest(study: Study, made_with: str) -> dict[str, Any]:
    """What a folder says of its study."""
    return {
        "format": FORMAT, "study": study.digest, "ncgen": __version__, "numpy": np.__version__, "model": study.model.name,
        "variants": study.size, "design": study.design.kind, "shape": list(study.design.shape), "names": list(study.design.names),
        "kept": [column.word for column in study.kept], "times": study.times.tolist(), "made_with": made_with,
    }  # fmt: skip
