"""Files of the user's: opened so that nothing waits or is changed, written so that nobody sees half of one, and locked.

All of ncgen opens what it did not make itself here (tests/test_structure.py checks it).
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from typing import IO, Any, TypeVar, cast

from ncgen.errors import NcgenError, given_twice, shown

READING = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
"""Flags under which opening waits for nobody: a pipe without a writer would hold a process for ever."""

LOCKING = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)
"""Flags under which a lock is made where it is missing, changes nothing in a file that is there, and follows no symbolic link."""

Method = TypeVar("Method", bound=Callable[..., Any])

KINDS = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device", stat.S_IFSOCK: "a socket"}
"""{type of a file: in words} of those that are not ordinary."""


def kind_of(mode: int) -> str:
    """What a file is that is not ordinary, in words; "" for an ordinary one. mode: st_mode"""
    return "" if stat.S_ISREG(mode) else KINDS.get(stat.S_IFMT(mode), "something else")


def is_there(path: Path) -> bool:
    """Whether something has a name; False for names that nothing can have."""
    return _mode(path) is not None


def is_file(path: Path) -> bool:
    """True for what can be read to an end: no folder, no device, no pipe; False for names that no file can have."""
    return stat.S_ISREG(_mode(path) or 0)


def is_folder(path: Path) -> bool:
    """Whether a name is that of a folder; False for names that no folder can have."""
    return stat.S_ISDIR(_mode(path) or 0)


def _mode(path: Path) -> int | None:
    try:
        return os.stat(path).st_mode
    except (OSError, ValueError):
        return None


def argument_was(former: str, today: str = "output") -> Callable[[Method], Method]:
    """Let callers name an argument by its former name as well.

    Parameters
    ----------
    former : str
        The former name, such as `path` or `folder`.
    today : str, optional
        Its name; by default that of the file or folder that a function writes.

    Returns
    -------
    callable
        A decorator that keeps the type of the function.
    """

    def decorate(function: Method) -> Method:
        @wraps(function)
        def renamed(*args: Any, **keywords: Any) -> Any:
            if former in keywords:
                if today in keywords:
                    raise given_twice(function.__name__, former, today)
                keywords[today] = keywords.pop(former)
            return function(*args, **keywords)

        return cast(Method, renamed)

    return decorate


# -- reading ---------------------------------------------------------------------------------------------------------------


def opened(path: str | os.PathLike[str]) -> IO[bytes]:
    """Open an ordinary file for reading, without waiting. Raises OSError, in words, for a folder, a pipe, a device, and a missing file."""
    return _ordinary(path, READING, "rb")


def contents(path: str | os.PathLike[str], largest: int) -> bytes:
    """Read an ordinary file whole. largest: its bytes at most. Raises OSError, in words, for anything else and for a larger one."""
    with opened(path) as file:
        data = file.read(largest + 1) or b""  # None where a file of the system would let its reader wait
    if len(data) > largest:
        raise OSError(errno.EFBIG, f"it has more than {largest} bytes", str(path))
    return data


def _ordinary(path: str | os.PathLike[str], flags: int, mode: str) -> IO[bytes]:
    try:
        descriptor = os.open(path, flags, 0o644)
    except ValueError as error:
        raise OSError(errno.EINVAL, "no file can have this name", shown(path)) from error
    if kind := kind_of(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, f"it is {kind}, and no ordinary file", str(path))
    return os.fdopen(descriptor, mode)


# -- locking ---------------------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def locked(path: Path) -> Iterator[bool]:
    """Hold a lock while the block runs: True where this process has it, False where another one does.

    The file is made where it is missing; a symbolic link is refused, and nothing in a file is changed. A process that died holds nothing.
    Raises OSError, in words, where there can be no lock.
    """
    try:
        file = _ordinary(path, LOCKING, "r+b")
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, "it is a symbolic link", str(path)) from error
        raise
    with file:
        yield _flocked(file)


def _flocked(file: IO[bytes]) -> bool:
    try:
        import fcntl
    except ImportError:  # Windows: nothing is held there
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


# -- writing ---------------------------------------------------------------------------------------------------------------


def path_of(output: str | os.PathLike[str], kind: str = "file") -> Path:
    """A path that something is to be written to. Raises NcgenError for what is not one."""
    if not isinstance(output, (str, os.PathLike)) or not str(output):
        raise NcgenError(f"output: {shown(output)} given; name a {kind}")
    return Path(output)


def write_text(path: Path, text: str) -> Path:
    """Write a text file atomically: to a temporary name in the same folder, then renamed."""
    return write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, data: bytes) -> Path:
    """Write a file atomically, into a folder that is made if missing. Raises NcgenError naming the file if it cannot be written."""
    with writing(path) as file:
        file.write(data)
    return path


@contextlib.contextmanager
def writing(path: Path) -> Iterator[IO[bytes]]:
    """A file that comes to have its name, in a folder that is made if missing, when the block ends without an exception.

    Raises NcgenError naming the file if it cannot be written.
    """
    if "\0" in str(path):
        raise NcgenError(f"{shown(str(path))} cannot be written: no file can have this name; choose another one")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path, f".{path.name}.") as file:
            yield file
    except OSError as error:
        raise NcgenError(f"{path} cannot be written: {error.strerror or error}; choose another folder") from error


def put(path: Path, data: bytes, prefix: str) -> Path:
    """Write a file under a temporary name, which begins with prefix, in the same folder and rename it. Raises OSError."""
    with replacing(path, prefix) as file:
        file.write(data)
    return path


@contextlib.contextmanager
def replacing(path: Path, prefix: str) -> Iterator[IO[bytes]]:
    """A file under a temporary name, which begins with prefix, in the same folder, renamed when the block ends without an exception.

    The name is one that nobody has, so no link is followed; a link at `path` gives way to the file. Raises OSError, also where what stands
    there is a folder, a pipe or a device, which a rename would replace.
    """
    with contextlib.suppress(FileNotFoundError):
        if kind := kind_of(os.stat(path).st_mode):
            raise OSError(errno.EEXIST, f"{kind} stands there", str(path))
    temporary = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=prefix, delete=False) as file:
            temporary = file.name
            yield file
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        if temporary:
            Path(temporary).unlink(missing_ok=True)
        raise
