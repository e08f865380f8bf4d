"""The cache of compiled libraries: one folder a key, published with one rename.

A library is built in a temporary folder inside the cache, tried, and renamed to its key when it is complete. Two builders of
the same key both succeed, the second discarding its copy; a builder that is killed leaves only a temporary folder, which is
never looked at and goes in a day.
"""

from __future__ import annotations

import errno
import hashlib
import os
import secrets
import shlex
import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ncgen.errors import CompileError, NcgenError
from ncgen.files import opened
from ncgen.toolchain import compilers
from ncgen.toolchain.cache_location import KEY, TEMPORARY, cache_folder, folders, forget, intruder, sealed, sweep, unsealed, written
from ncgen.toolchain.compilers import FLAGS, LIBRARIES, LIBRARY, Compiler, Recipe
from ncgen.toolchain.preparation import preparing

RECORD = "build.json"


@dataclass(frozen=True)
class BuiltLibrary:
    """A compiled library; seconds is the compile time, 0 if it came from the cache; spent: now or when it came into the cache."""

    library: Path
    seconds: float
    spent: float


@dataclass(frozen=True)
class Sibling:
    """Another library, of files and flags, and those of its sources whose objects are the same in both."""

    files: dict[str, str]
    flags: tuple[str, ...]
    sources: tuple[str, ...]


@preparing()
def compiled(
    files: dict[str, str],
    flags: tuple[str, ...] = FLAGS,
    libraries: tuple[str, ...] = LIBRARIES,
    time_limit: float = 0.0,
    siblings: Callable[[], Sequence[Sibling]] = tuple,
) -> BuiltLibrary:
    """The library of some C sources, from the cache or compiled now by the first compiler that works.

    siblings: called where the library is not in the cache, for others whose objects are taken, of the first one that has them
    time_limit: seconds that a compiler may take at least, where headers are much longer than what is given here
    A flag that a compiler refuses is left out if code is only slower without it. What was left out and which compilers failed
    is reported in one warning, and found out once in a process.
    Raises CompileError with the compiler's log if there is none, or none that works.
    """
    failures: list[CompileError] = []
    news: list[str] = []
    for compiler in compilers.find_compilers():
        if known := compilers.useless(compiler):
            failures.append(known)
            continue
        while True:
            taken = compilers.accepted(compiler, (*flags, *compilers.own_flags()))
            try:
                built = build(
                    files, compiler, taken, libraries, time_limit=time_limit, objects=lambda: _objects(siblings(), compiler, libraries)
                )
            except CompileError as error:
                if refused := compilers.examine(compiler, taken, error):
                    news += [
                        f"{compiler.name} refuses {flag} and is used without it" for flag in refused if flag not in compilers.OPTIONAL_FLAGS
                    ]
                    continue
                failures.append(error)
                news.append(f"{_short(error, 120)}; {{}} is used instead")
                break
            if news:
                warnings.warn("; ".join(news).replace("{}", compiler.name)[:300], stacklevel=2)
            return built
    raise _summary(failures)


def _summary(failures: list[CompileError]) -> CompileError:
    """Why no compiler could be used, in one line, with the first log."""
    if not failures:
        return CompileError("no C compiler found (tried CC, cc, gcc, clang, ziglang); install gcc or clang")
    if len(failures) == 1:
        return CompileError(str(failures[0]), failures[0].log)
    text = "; ".join(_short(failure, 240 // len(failures)) for failure in failures)
    return CompileError(f"no C compiler works: {text}", next((failure.log for failure in failures if failure.log), ""))


def _short(error: CompileError, length: int) -> str:
    """What happened, without advice."""
    return str(error).split("; set CC")[0][:length]


def build(
    files: dict[str, str],
    compiler: Compiler,
    flags: tuple[str, ...] = FLAGS,
    libraries: tuple[str, ...] = LIBRARIES,
    loads: bool = True,
    time_limit: float = 0.0,
    objects: Callable[[], Mapping[str, Path]] = dict,
) -> BuiltLibrary:
    """The library of some C sources by one compiler, from the cache or compiled now.

    loads: whether it is for this process, which is then able to load it
    objects: called where it has to be compiled, for {source: its object} of what was compiled before
    Raises CompileError with the compiler's log if it fails.
    """
    recipe = Recipe(files, compiler, flags, libraries)
    key = _key(recipe)
    for folder in folders():
        if record := _record(folder / key, loads):
            return BuiltLibrary(folder / key / LIBRARY, 0.0, record["seconds"])
    try:
        return written(lambda folder: _build(folder / key, recipe, loads, time_limit, objects()))
    except OSError as error:
        raise CompileError(
            f"there is no room to compile in: {error.strerror or error}; set NCGEN_CACHE_DIR to a folder with some"
        ) from error


def _key(recipe: Recipe) -> str:
    digest = hashlib.sha256()
    fields = [recipe.compiler.identity, *recipe.compiler.command, *recipe.flags, *recipe.libraries]
    for name in sorted(recipe.files):
        fields += [name, recipe.files[name]]
    for field in fields:
        data = field.encode()
        digest.update(len(data).to_bytes(8, "little") + data)
    return digest.hexdigest()[:40]


def _build(entry: Path, recipe: Recipe, loads: bool, time_limit: float, objects: Mapping[str, Path]) -> BuiltLibrary:
    """Compile and publish an entry. Raises OSError where its folder does not take it."""
    work = Path(tempfile.mkdtemp(prefix=TEMPORARY, dir=entry.parent))
    try:
        if problem := intruder(work):  # on some network drives nothing belongs to who made it
            raise PermissionError(errno.EACCES, problem)
        start = time.perf_counter()
        command, log = compilers.make_library(work, recipe, loads, time_limit, objects)
        seconds = time.perf_counter() - start
        record = {"command": command, "seconds": round(seconds, 3), "log": log, "library": _digest(work / LIBRARY)}
        record["objects"] = {source: _digest(path) for source, path in compilers.objects_of(work).items()}
        (work / RECORD).write_bytes(sealed(record))
        _publish(work, entry, loads)
    finally:
        shutil.rmtree(work, ignore_errors=True)
        sweep()
    return BuiltLibrary(entry / LIBRARY, seconds, seconds)


def _objects(siblings: Sequence[Sibling], compiler: Compiler, libraries: tuple[str, ...]) -> dict[str, Path]:
    """{source: its object} of siblings that this compiler has built: those that are as they were written."""
    objects: dict[str, Path] = {}
    for sibling in siblings:
        if not objects.keys() >= set(sibling.sources):
            objects = _objects_of(sibling, compiler, libraries) | objects
    return objects


def _objects_of(sibling: Sibling, compiler: Compiler, libraries: tuple[str, ...]) -> dict[str, Path]:
    """The same of one sibling."""
    flags = compilers.accepted(compiler, (*sibling.flags, *compilers.own_flags()))
    key = _key(Recipe(sibling.files, compiler, flags, libraries))
    entries = [folder / key for folder in folders()]
    entry, record = next(((entry, record) for entry in entries if (record := _record(entry, True))), (Path(), None))
    known: dict[str, str] = record.get("objects", {}) if record else {}
    objects = {source: path for source, path in compilers.objects_of(entry).items() if source in sibling.sources} if known else {}
    return {source: path for source, path in objects.items() if not intruder(path) and _digest(path) == known.get(source)}


def _record(entry: Path, loads: bool) -> dict[str, Any] | None:
    """What is known of an entry if its library is there as it was built and can be loaded, and nobody else could have touched it:
    a damaged one would crash the process that loads it, or worse."""
    if intruder(entry / LIBRARY):
        return None
    record = unsealed(entry / RECORD)
    try:
        whole = record is not None and record["library"] == _digest(entry / LIBRARY)
    except OSError:
        return None
    return record if whole and not (loads and compilers.unloadable(entry / LIBRARY)) else None


def build_command(library: Path) -> list[str]:
    """Return the compiler and its arguments that built a library of the cache; [] where that is not recorded."""
    command = (unsealed(library.parent / RECORD) or {}).get("command", [])
    return shlex.split(command) if isinstance(command, str) else list(map(str, command))


def _digest(path: Path) -> str:
    with opened(path) as file:
        return hashlib.sha256(file.read()).hexdigest()


def _publish(work: Path, entry: Path, loads: bool) -> None:
    """Rename the finished folder to its key; what stands there is kept if it is whole, else put aside and removed."""
    for path in work.iterdir():
        path.chmod(0o644)
    work.chmod(0o755)
    for last in (False, True):
        try:
            os.rename(work, entry)
            return
        except OSError:
            if _record(entry, loads):
                return
            if last or not entry.is_dir():
                raise
            _discard(entry)


def _discard(entry: Path) -> None:
    """Put an entry aside with one rename, so that nobody sees it half removed, and remove it."""
    removed = entry.parent / f"{TEMPORARY}{secrets.token_hex(4)}"
    try:
        os.rename(entry, removed)
    except FileNotFoundError:
        return  # another process was quicker
    shutil.rmtree(removed, ignore_errors=True)


@dataclass(frozen=True)
class CacheEntry:
    """One library in the cache."""

    key: str
    sources: tuple[str, ...]
    size: int
    age: float


def entries() -> list[CacheEntry]:
    """What the cache holds, newest first; folders that are no entries are not listed."""
    listed = []
    for folder in cache_folder().glob("*"):
        try:
            if _is_entry(folder):
                files = [f for f in folder.iterdir() if f.is_file()]
                size = sum(f.stat().st_size for f in files)
                age = time.time() - (folder / RECORD).stat().st_mtime
                listed.append(CacheEntry(folder.name, tuple(sorted(f.name for f in files if f.suffix == ".c")), size, age))
        except OSError:
            continue  # another process is clearing the cache, or it is not this user's
    return sorted(listed, key=lambda e: e.age)


def _is_entry(folder: Path) -> bool:
    """True for what `build` has made, whole or not: it has a key for a name, and both files."""
    made = KEY.fullmatch(folder.name) and not folder.is_symlink()
    return bool(made) and (folder / RECORD).is_file() and (folder / LIBRARY).is_file()


def clear() -> int:
    """Remove all entries, what was cached with them, and abandoned builds; returns how many libraries went.

    Raises NcgenError if the system does not let them go.
    """
    known = entries()
    try:
        sweep()
        forget()
        for entry in known:
            _discard(cache_folder() / entry.key)
    except OSError as error:
        raise NcgenError(f"cache folder {cache_folder()} cannot be cleared: {error.strerror or error}; remove it yourself") from error
    return len(known)
