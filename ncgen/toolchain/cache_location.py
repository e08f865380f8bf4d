"""The cache folder: where it is, whether it is the user's alone, and what stands in for it where it cannot be used.

What lies there becomes machine code of this process, so nothing is read that anybody else could have written: a file counts only
if it belongs to the user, nobody else may write to it, and nobody else may put another one in its place. A folder that is not
like this, or that cannot be written, is an inconvenience and no error: it is reported once, and a temporary folder of this process
stands in for it.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import shutil
import stat
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from multiprocessing import util
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import platformdirs

from ncgen.errors import CompileError
from ncgen.files import contents, put

CACHED_FOLDERS = ("programs", "generators", "interfaces", "references", "facts", "mjcf")
"""Folders beside the libraries, of what `keep` writes: generated programs (ncgen.mechanism.recall), digests of the generator
(ncgen.mechanism.generator_identity), declarations (ncgen.toolchain.interfaces), end positions known well
(ncgen.report.precision), the examples' degrees of freedom (ncgen.report.gallery), MuJoCo's models (ncgen.exchange.robots.mjcf_kept)."""

TEMPORARY = "ncgen-building-"
"""What the names of unfinished things begin with; nobody looks into them."""

ABANDONED_SECONDS = 24 * 3600.0
"""Seconds after which an unfinished thing is nobody's any more; no build may take as long."""

MAX_FILE_BYTES = 100_000_000
"""Bytes of a file with a digest, which holds the programs of a mechanism at most."""

KEY = re.compile(r"[0-9a-f]{40}")
UNFINISHED = re.compile(rf"{TEMPORARY}[a-z0-9_]{{8}}")

Result = TypeVar("Result")

Json: TypeAlias = "None | bool | int | float | str | Sequence[Json] | Mapping[str, Json]"
"""What JSON can say."""

_stand_ins: dict[Path, Path] = {}
"""{cache folder: the temporary folder that stands in for it} in this process."""


def cache_folder() -> Path:
    """$NCGEN_CACHE_DIR, or the user's cache folder."""
    chosen = os.environ.get("NCGEN_CACHE_DIR")
    return Path(os.path.expanduser(chosen) if chosen else platformdirs.user_cache_dir("ncgen"))


def folders() -> tuple[Path, ...]:
    """Where to look for what was kept: the cache folder if it is the user's alone, and its stand-in if there is one.

    The last one is where to write.
    """
    folder = cache_folder()
    real = Path(os.path.realpath(folder))
    problem = "there is no home folder" if str(folder).startswith("~") else intruder(real)
    if problem and real not in _stand_ins:
        _stand_in(real, f"cache folder {folder} is not used: {problem}")
    existing = () if problem else (real,)
    return (*existing, _stand_ins[real]) if real in _stand_ins else existing


def written(write: Callable[[Path], Result]) -> Result:
    """write(folder) in the folder to write to, or in its stand-in if the operating system refuses.

    Raises OSError where that is refused, too.
    """
    folder = folders()[-1]
    try:
        make(folder)
        return write(folder)
    except OSError as error:
        if folder in _stand_ins.values():
            raise
        folder = _stand_in(folder, f"cache folder {folder} cannot be written: {error.strerror or error}")
        return write(folder)


def _stand_in(folder: Path, problem: str) -> Path:
    """Say what is wrong with a folder and make a temporary one, which goes when this process does."""
    try:
        _stand_ins[folder] = made = Path(os.path.realpath(tempfile.mkdtemp(prefix="ncgen-")))
    except OSError as error:
        raise CompileError(f"{problem[:150]}, and no temporary folder can be made: {error.strerror}; set NCGEN_CACHE_DIR") from error
    # Unlike atexit this also runs where a process of multiprocessing ends, and not in a forked one that did not make the folder.
    util.Finalize(None, shutil.rmtree, args=(made, True), exitpriority=0)
    warnings.warn(f"{problem[:200]}; nothing is kept from this process: set NCGEN_CACHE_DIR to a folder of your own", stacklevel=2)
    return made


def make(folder: Path) -> None:
    """Make a folder and those above it, open to read and closed to write whatever the umask is."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    for path in reversed(missing):
        path.mkdir(mode=0o755, exist_ok=True)
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))


# -- whose is it -----------------------------------------------------------------------------------------------------------


def intruder(path: Path) -> str | None:
    """Who else could have written a file or folder or could replace it, in words; None if nobody, or if it is not there yet.

    path: without symbolic links
    """
    if not hasattr(os, "geteuid"):
        return None  # elsewhere than on POSIX a user's cache folder is closed to others by where it is
    for parent in (path, *path.parents):
        try:
            status = os.lstat(parent)
        except OSError:
            continue  # it is not there yet, or cannot be seen and then not be read either
        # In a folder with the sticky bit others can add files, but not replace those of this user.
        closed = status.st_mode & stat.S_ISVTX and parent is not path
        if status.st_uid not in _owners():
            return f"{parent} belongs to another user"
        if stat.S_ISLNK(status.st_mode):
            return f"{parent} is a symbolic link"
        if not closed and (status.st_mode & stat.S_IWOTH or status.st_mode & stat.S_IWGRP and not _is_private(status.st_gid)):
            return f"others may write to {parent}"
    return None


def _owners() -> set[int]:
    """The user, and the system's owner, who can do everything anyway (in a container the owner of / may have another number)."""
    return {os.geteuid(), 0, os.stat("/").st_uid}


@cache
def _is_private(group: int) -> bool:
    """True for the group that a user has alone and by the same name, for which some systems let a group write by default."""
    import grp
    import pwd

    try:
        user, entry = pwd.getpwuid(os.geteuid()).pw_name, grp.getgrgid(group)
    except KeyError:
        return False
    return entry.gr_name == user and set(entry.gr_mem) <= {user}


# -- small things that are kept, with a digest --------------------------------------------------------------------------------


def keep(kind: str, key: str, value: Json, largest: int = 1_000_000) -> None:
    """Keep what JSON can say, for `kept` of the same kind (one of CACHED_FOLDERS) and key (40 hexadecimal digits) in any process.

    largest: bytes above which it is not kept
    """
    data = sealed(value)
    if len(data) > largest:
        return

    def write(folder: Path) -> None:
        make(folder / kind)
        if problem := intruder(folder / kind):
            raise PermissionError(errno.EACCES, problem)
        put(folder / kind / f"{key}.json", data, TEMPORARY)

    try:
        written(write)
    except OSError:
        pass  # the cache has been complained about already, and what is not kept is only found again


def kept(kind: str, key: str) -> Any:
    """What was kept under a key; None if nothing was, it is damaged, or somebody else could have written it."""
    return next((value for folder in folders() if (value := unsealed(folder / kind / f"{key}.json")) is not None), None)


def sealed(value: Json) -> bytes:
    """A value that JSON can say, every digit of every number, below a line with its digest."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":")).encode()
    return hashlib.sha256(text).hexdigest().encode() + b"\n" + text


def unsealed(path: Path) -> Any:
    """The value of a file that `sealed` wrote; None if it is not there, not whole or not the user's alone."""
    if intruder(path):
        return None
    try:
        seal, _, text = contents(path, MAX_FILE_BYTES).partition(b"\n")
        return json.loads(text) if hashlib.sha256(text).hexdigest().encode() == seal else None
    except (OSError, ValueError):
        return None


# -- order ---------------------------------------------------------------------------------------------------------------------


def forget() -> None:
    """Remove all that `keep` wrote into the cache folder, and nothing else."""
    for kind in CACHED_FOLDERS:
        folder = cache_folder() / kind
        for path in folder.glob("*.json"):
            if KEY.fullmatch(path.stem) and path.is_file():
                path.unlink(missing_ok=True)
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()


def sweep() -> None:
    """Remove what processes that were killed left in the cache folder."""
    for folder in (cache_folder(), *(cache_folder() / kind for kind in CACHED_FOLDERS)):
        for path in folder.glob(f"{TEMPORARY}*"):
            try:
                if UNFINISHED.fullmatch(path.name) and time.time() - path.lstat().st_mtime > ABANDONED_SECONDS:
                    shutil.rmtree(path) if path.is_dir() else path.unlink()
            except OSError:
                continue  # whoever made it has just finished, or it is not this user's to remove
