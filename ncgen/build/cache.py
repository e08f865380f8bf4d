"""The cache of compiled libraries: one folder a key, published with one rename.

A library is built in a temporary folder inside the cache and renamed to its key when it is complete. Two
builders of the same key both succeed, the second discarding its copy; a builder that is killed leaves only
a temporary folder, which is never looked at.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import platformdirs

from ncgen.build.compilers import FLAGS, Compiler
from ncgen.errors import CompileError, NcgenError

LIBRARY = "model.so"
RECORD = "build.json"
TEMPORARY = "building-"
ABANDONED = 24 * 3600.0
"""Seconds after which a temporary folder is nobody's any more."""


KEPT = ("programs", "references")
"""Folders beside the libraries: generated programs (ncgen.build.recall), end positions known well (ncgen.report.precision)."""


def cache_folder() -> Path:
    """$NCGEN_CACHE_DIR, or the user's cache folder."""
    chosen = os.environ.get("NCGEN_CACHE_DIR")
    return Path(chosen).expanduser() if chosen else Path(platformdirs.user_cache_dir("ncgen"))


@dataclass(frozen=True)
class Built:
    """A compiled library; seconds is the compile time, 0 if it came from the cache."""

    library: Path
    seconds: float

    @property
    def spent(self) -> float:
        """Seconds its compilation took, now or when it came into the cache."""
        return json.loads((self.library.parent / RECORD).read_text(encoding="utf-8"))["seconds"]


def build(files: dict[str, str], compiler: Compiler, flags=FLAGS, libraries=("-lm",)) -> Built:
    """The library of some C sources, from the cache or compiled now.

    Raises CompileError with the compiler's log if it refuses, NcgenError if the cache cannot be written.
    """
    entry = cache_folder() / _key(files, compiler, flags, libraries)
    library = entry / LIBRARY
    if _is_whole(entry):
        return Built(library, 0.0)
    try:
        entry.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix=TEMPORARY, dir=entry.parent))
    except OSError as error:
        raise NcgenError(
            f"cache folder {entry.parent} cannot be written: {error.strerror}; set NCGEN_CACHE_DIR to a folder that can"
        ) from error
    try:
        seconds = _compile(work, files, compiler, flags, libraries)
        _publish(work, entry)
    except OSError as error:
        raise NcgenError(f"cache folder {entry.parent}: {error.strerror}; free some room or set NCGEN_CACHE_DIR") from error
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return Built(library, seconds)


def _key(files, compiler, flags, libraries) -> str:
    digest = hashlib.sha256()
    fields = [compiler.identity, *compiler.command, *flags, *libraries]
    for name in sorted(files):
        fields += [name, files[name]]
    for field in fields:
        data = field.encode()
        digest.update(len(data).to_bytes(8, "little") + data)
    return digest.hexdigest()[:40]


def _compile(work: Path, files, compiler, flags, libraries) -> float:
    for name, text in files.items():
        (work / name).write_text(text, encoding="utf-8")
    sources = sorted(name for name in files if name.endswith(".c"))
    command = [*compiler.command, *flags, *sources, "-o", LIBRARY, *libraries]
    start = time.perf_counter()
    try:
        done = subprocess.run(command, cwd=work, capture_output=True, text=True, encoding="utf-8", errors="replace")
    except OSError as error:
        raise CompileError(f"{compiler.command[0]} cannot be run: {error.strerror}; set CC to a C compiler") from error
    seconds = time.perf_counter() - start
    if done.returncode:
        first = next((line for line in done.stderr.splitlines() if "error" in line), " ".join(done.stderr.split())[:200])
        raise CompileError(f"{compiler.command[0]} refused the generated C: {first}", done.stderr)
    if not (work / LIBRARY).is_file():
        raise CompileError(f"{compiler.command[0]} reported success and wrote no library; set CC to a C compiler", done.stderr)
    record = {"command": command, "seconds": round(seconds, 3), "log": done.stderr, "library": _digest(work / LIBRARY)}
    (work / RECORD).write_text(json.dumps(record, indent=1), encoding="utf-8")
    return seconds


def _is_whole(entry: Path) -> bool:
    """True if the library is there as it was built: a damaged one would crash the process that loads it."""
    try:
        record = json.loads((entry / RECORD).read_text(encoding="utf-8"))
        return record["library"] == _digest(entry / LIBRARY)
    except (OSError, ValueError, KeyError):
        return False


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _publish(work: Path, entry: Path) -> None:
    """Rename the finished folder to its key; what stands there is kept if it is whole, else put aside and removed."""
    os.chmod(work, 0o755)
    for _ in range(2):
        try:
            os.rename(work, entry)
            return
        except OSError:
            if _is_whole(entry):
                return
            if not entry.is_dir():
                raise
            _discard(entry)


def _discard(entry: Path) -> None:
    """Put an entry aside with one rename, so that nobody sees it half removed, and remove it."""
    aside = Path(tempfile.mkdtemp(prefix=TEMPORARY, dir=entry.parent))
    try:
        os.rename(entry, aside / entry.name)
    except FileNotFoundError:
        pass  # another process was quicker
    shutil.rmtree(aside, ignore_errors=True)


@dataclass(frozen=True)
class Entry:
    """One library in the cache."""

    key: str
    sources: tuple[str, ...]
    size: int
    age: float


def entries() -> list[Entry]:
    """What the cache holds, newest first; folders that are no entries are not listed."""
    found = []
    for folder in cache_folder().glob("*"):
        try:
            if (folder / RECORD).is_file() and (folder / LIBRARY).is_file():
                files = [f for f in folder.iterdir() if f.is_file()]
                size = sum(f.stat().st_size for f in files)
                age = time.time() - (folder / RECORD).stat().st_mtime
                found.append(Entry(folder.name, tuple(sorted(f.name for f in files if f.suffix == ".c")), size, age))
        except OSError:
            continue  # another process is clearing the cache
    return sorted(found, key=lambda e: e.age)


def clear() -> int:
    """Remove all entries, what was kept beside them, and abandoned builds; returns how many libraries went."""
    known = entries()
    for name in KEPT:
        shutil.rmtree(cache_folder() / name, ignore_errors=True)
    for entry in known:
        _discard(cache_folder() / entry.key)
    for folder in cache_folder().glob(f"{TEMPORARY}*"):
        try:
            abandoned = time.time() - folder.stat().st_mtime > ABANDONED
        except OSError:
            continue  # its builder has just finished
        if abandoned:
            shutil.rmtree(folder, ignore_errors=True)
    return len(known)
