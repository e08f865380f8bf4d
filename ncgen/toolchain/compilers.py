"""Finding a C compiler, what is asked of it, and what it turns out to be able to do.

Order: `$CC` and nothing else, or cc, gcc and clang on the path, then the compiler of the Python package ziglang.
"""

from __future__ import annotations

import errno
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType

import _cffi_backend

from ncgen.errors import CompileError
from ncgen.files import opened

ALIGNED = ("-falign-functions=64", "-falign-loops=64")
"""Functions and loops begin with a line of the cache: the same code runs up to a tenth slower where other code moves it."""

FLAGS = ("-std=c99", "-O3", "-march=native", "-fno-tree-slp-vectorize", "-ffp-contract=fast", *ALIGNED, "-fPIC", "-shared")
"""No -ffast-math: sums keep their order. Fused multiply-adds, where the processor has them, halve the rounding error of the
robot's kernels and save a quarter of their time; the price is a last bit that depends on the processor."""

FLAGS_FOR_LONG_CODE = ("-fexpensive-optimizations", "-ftree-loop-vectorize")
"""What long straight lines need of what -O3 is more than -O1: fused multiply-adds, and loops of sines and cosines in lanes."""

DISABLED_PASSES = (
    "-fno-dce", "-fno-dse", "-fno-ipa-modref", "-fno-tree-ccp", "-fno-tree-dominator-opts", "-fno-tree-dse", "-fno-tree-sink",
)  # fmt: skip
"""Passes of -O1 that find nothing in code without dead stores, constants to fold or branches: a fifth of gcc's time, and of 27,492
instructions of a robot's positions they save 19."""

STRAIGHT_FLAGS = tuple(each for flag in FLAGS for each in (("-O1", *FLAGS_FOR_LONG_CODE, *DISABLED_PASSES) if flag == "-O3" else (flag,)))
"""For long straight lines. gcc takes three quarters of the time of -O3 for a humanoid's motion, whose programs run as fast and have as many
instructions: there are no branches and no common subexpressions that it could find."""

LONG_LINES = 150_000
"""Characters of straight lines, which gcc takes 1 s for, above which it does what they need and no more."""

OPTIONAL = (
    "-march=native", "-fno-tree-slp-vectorize", "-ffp-contract=fast", *ALIGNED, *FLAGS_FOR_LONG_CODE, *DISABLED_PASSES,
    "-fno-math-errno", "-fopenmp",
    "-fcx-limited-range",
)  # fmt: skip
"""Flags that make code faster and no different: a compiler that refuses one is used without it."""

OPTIONAL_FLAGS = ("-fopenmp", *DISABLED_PASSES)
"""Those whose absence is no news: batches say whether they have threads, and code is as fast with a pass that finds nothing."""

LIBRARIES = ("-lm",)
LIBRARY = "model.so"

TIME_LIMIT = 30.0
"""Seconds that a compiler has for any source, and for each thousand bytes of it …"""
SECONDS_PER_KILOBYTE = 1.0
MAX_TIME_LIMIT = 6 * 3600.0
"""… but never more than this."""

FEW_SOURCES = 6
"""A compiler is given at least as many where there are several …"""

LONG_SOURCE = 100_000
"""… or one of at least so many characters, which takes it half a second: more than it takes to start."""

NO_OBJECTS: Mapping[str, Path] = MappingProxyType({})

PROBE = {"probe.c": "int ncgen_probe(void) { return 1; }\n"}


def own_flags() -> tuple[str, ...]:
    """What NCGEN_CFLAGS adds to the flags of every library that ncgen compiles for itself, such as -O1: quicker to compile, slower to run.

    Raises CompileError where it cannot be read.
    """
    added = os.environ.get("NCGEN_CFLAGS", "")
    try:
        return tuple(shlex.split(added))
    except ValueError as error:
        raise CompileError(f"NCGEN_CFLAGS={added}: {error}; correct NCGEN_CFLAGS or unset it") from None


def flags_for(files: Mapping[str, str]) -> tuple[str, ...]:
    """Flags for {file name: text} of a mechanism's own, which are straight lines and loops over tables."""
    return STRAIGHT_FLAGS if sum(map(len, files.values())) > LONG_LINES else FLAGS


@dataclass(frozen=True)
class Compiler:
    """command: how to call it; identity: what tells one compiler on one processor from another."""

    command: tuple[str, ...]
    identity: str

    @property
    def name(self) -> str:
        """What messages call it: as it is called in a shell."""
        if "ziglang" in self.command:
            return "ziglang"
        short = Path(self.command[0]).name
        return short if shutil.which(short) == self.command[0] else self.command[0]

    @property
    def makes_every_object(self) -> bool:
        """Whether a call with -c makes an object of every source that it is given. Zig makes one of the first; in one call it compiles many
        side by side."""
        return "ziglang" not in self.command and Path(self.command[0]).stem != "zig"


# -- finding -------------------------------------------------------------------------------------------------------------------


def processor() -> str:
    """Return what the processor of this machine is called."""
    names = (line.split(":", 1)[1].strip() for line in _cpuinfo() if line.startswith("model name"))
    return next(names, "") or platform.processor() or platform.machine()


@cache
def _cpuinfo() -> tuple[str, ...]:
    """The lines in which Linux describes the processors of this machine; empty elsewhere."""
    try:
        return tuple(Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines())
    except OSError:
        return ()


@cache
def version_line(program: str) -> str:
    """Return the first line that a compiler prints of its version; "" where it prints nothing."""
    try:
        done = subprocess.run([program, "--version"], capture_output=True, text=True, timeout=10, stdin=subprocess.DEVNULL)
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.partition("\n")[0].strip()


def find_compiler() -> Compiler | None:
    """The first compiler found, or None. Raises CompileError if `$CC` names one that does not exist."""
    return next(find_compilers(), None)


def find_compilers() -> Iterator[Compiler]:
    """All compilers, each once, in the order in which they are tried. Raises CompileError if `$CC` names one that does not exist."""
    wanted = os.environ.get("CC", "")
    if wanted.strip():
        yield _wanted(wanted)
        return
    identities = set()
    for path in filter(None, map(shutil.which, ("cc", "gcc", "clang"))):
        if (compiler := Compiler((path,), _identity(path))).identity not in identities:
            identities.add(compiler.identity)
            yield compiler
    if importlib.util.find_spec("ziglang"):
        yield zig()


def zig() -> Compiler:
    """The compiler of the Python package ziglang."""
    from importlib.metadata import version  # which takes long to import

    return Compiler((sys.executable, "-m", "ziglang", "cc"), f"ziglang {version('ziglang')}:{_machine()}")


def _wanted(wanted: str) -> Compiler:
    """The compiler that `$CC` names."""
    try:
        command = shlex.split(wanted)
    except ValueError as error:
        raise CompileError(f"CC={wanted}: {error}; correct CC or unset it") from None
    path = shutil.which(command[0])
    if path is None:
        raise CompileError(f"CC={wanted}: there is no such program; correct CC or unset it")
    path = str(Path(path).absolute())  # the compiler runs in another folder
    return Compiler((path, *command[1:]), _identity(path))


def _identity(path: str) -> str:
    """The program file behind a name, by path, size and time of change, and the machine."""
    real = Path(path).resolve()
    status = real.stat()
    return f"{real}:{status.st_size}:{status.st_mtime_ns}:{_machine()}"


@cache
def _machine() -> str:
    """The processor, which -march=native depends on, and the C library: what is built for one must not run on a lesser one."""
    description = sorted({line for line in _cpuinfo() if line.startswith(("flags", "Features", "model name", "CPU part"))})
    description += [platform.system(), platform.machine(), os.environ.get("PROCESSOR_IDENTIFIER", "")]
    if "CS_GNU_LIBC_VERSION" in getattr(os, "confstr_names", {}):
        description.append(os.confstr("CS_GNU_LIBC_VERSION") or "")
    return hashlib.sha256("\n".join(description).encode()).hexdigest()[:16]


# -- compiling -----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Recipe:
    """All that decides what a library becomes: sources {file name: text}, the compiler, its flags, and other libraries."""

    files: dict[str, str]
    compiler: Compiler
    flags: tuple[str, ...]
    libraries: tuple[str, ...] = ()


def make_library(
    folder: Path, recipe: Recipe, loads: bool = True, time_limit: float = 0.0, objects: Mapping[str, Path] = NO_OBJECTS
) -> tuple[list[str], str]:
    """Write sources into a folder and compile them to LIBRARY there; the command and what the compiler said.

    objects: of sources that were compiled before, as `objects_of` finds them
    loads: whether this process must be able to load what comes out; time_limit: seconds that it may take at least
    Raises CompileError with the compiler's log if it fails, OSError where the folder cannot hold what is written.
    """
    files, compiler, flags = recipe.files, recipe.compiler, recipe.flags
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    time_limit = max(time_limit, min(MAX_TIME_LIMIT, TIME_LIMIT + SECONDS_PER_KILOBYTE * sum(map(len, files.values())) / 1000))
    groups = _groups({name: len(text) for name, text in files.items() if name.endswith(".c") and name not in objects})
    inputs, log = [name for group in groups for name in group], ""
    if inputs and (len(groups) > 1 or objects) and compiler.makes_every_object:
        apart = [flag for flag in flags if flag != "-shared"]
        log = _run(compiler, [[*compiler.command, *apart, "-c", *group] for group in groups if group], folder, time_limit)
        inputs = [str(Path(name).with_suffix(".o")) for name in inputs]
    command = [*compiler.command, *flags, *inputs, *map(str, objects.values()), "-o", LIBRARY, *recipe.libraries]
    log += _run(compiler, [command], folder, time_limit)
    if not (folder / LIBRARY).is_file():
        raise CompileError(f"{compiler.name} reported success and wrote no library; set CC to a C compiler", log)
    if loads and (problem := unloadable(folder / LIBRARY)):
        raise CompileError(f"{compiler.name} wrote a library that cannot be loaded: {problem[:120]}; set CC to a C compiler", log)
    return command, log


def objects_of(folder: Path) -> dict[str, Path]:
    """{source: its object} of those that a compiler made one by one in a folder."""
    return {path.with_suffix(".c").name: path for path in sorted(folder.glob("*.o"))}


def _groups(sizes: dict[str, int]) -> list[list[str]]:
    """Sources for as many compilers at a time as there are processors, about as much text for each; few short sources go together."""
    long = sum(size >= LONG_SOURCE for size in sizes.values())
    count = min(os.cpu_count() or 1, max(len(sizes) // FEW_SOURCES, long)) or 1
    groups: list[list[str]] = [[] for _ in range(count)]
    for name in sorted(sizes, key=lambda name: (-sizes[name], name)):
        min(groups, key=lambda group: sum(sizes[each] for each in group)).append(name)
    return [sorted(group) for group in groups]


def _run(compiler: Compiler, commands: list[list[str]], folder: Path, time_limit: float) -> str:
    """What a compiler says to some commands at a time in a folder; they and the processes that they start are stopped when time is up."""
    with tempfile.TemporaryDirectory(dir=folder) as scratch:  # what a compiler that is stopped leaves behind goes with it
        environment = os.environ | {"TMPDIR": scratch, "LC_ALL": "C"}
        nothing = subprocess.DEVNULL
        started: list[subprocess.Popen[bytes]] = []
        try:
            for command in commands:
                started.append(
                    subprocess.Popen(
                        command, cwd=folder, env=environment, start_new_session=True, stdin=nothing, stdout=nothing, stderr=subprocess.PIPE
                    )
                )
            logs = [process.communicate(timeout=time_limit)[1].decode("utf-8", errors="replace") for process in started]
        except subprocess.TimeoutExpired:
            raise CompileError(f"{compiler.name} was stopped after its limit of {time_limit:.3g} s; set CC to another compiler") from None
        except OSError as error:
            raise CompileError(f"{compiler.name} cannot be run: {error.strerror}; set CC to a C compiler") from error
        finally:
            for process in started:
                _stop(process)
    for process, log in zip(started, logs, strict=True):
        _judge(compiler, process.returncode, log, folder)
    return "".join(logs)


def _judge(compiler: Compiler, code: int, log: str, folder: Path) -> None:
    """Raise OSError where there was no room, CompileError where a compiler did not do its work."""
    for reason in (errno.ENOSPC, errno.EDQUOT):
        if code and os.strerror(reason) in log:
            raise OSError(reason, os.strerror(reason), str(folder))
    if code < 0:
        raise CompileError(f"{compiler.name} crashed with signal {-code}; set CC to another compiler", log)
    if code:
        first = next((line for line in log.splitlines() if "error" in line), " ".join(log.split()))[:200]
        raise CompileError(f"{compiler.name} refused the generated C: {first}", log)


def _stop(process: subprocess.Popen[bytes]) -> None:
    """End a process that has not ended, since its time is up or the user has lost patience, with all that it has started: politely, so
    that it can remove its temporary files, then for certain."""
    if process.returncode is not None:
        return
    for way in ("SIGTERM", "SIGKILL"):
        try:
            os.killpg(process.pid, getattr(signal, way)) if hasattr(os, "killpg") else process.kill()
        except ProcessLookupError:
            break
        try:
            process.communicate(timeout=2.0)
        except subprocess.TimeoutExpired:
            continue
    process.poll()
    if process.stderr is not None:
        process.stderr.close()


def unloadable(library: Path) -> str | None:
    """Why this process cannot load a library, in words; None if it can."""
    if _is_cut(library):
        return "it is not whole"
    ffi = _cffi_backend.FFI()
    try:
        ffi.dlclose(ffi.dlopen(str(library)))
    except OSError as error:
        message = str(error).replace(f"cannot load library '{library}': ", "").replace(f"{library}: ", "")
        return " ".join(message.split(".  Additionally")[0].split())
    return None


def _is_cut(library: Path) -> bool:
    """True for a library in the format ELF that ends before its table of sections, as a full disk leaves it: loading it would
    end this process, where a file of any other kind is refused by the system."""
    with opened(library) as file:
        head = file.read(64)
    if head[:4] != b"\x7fELF" or len(head) < 64:
        return False
    order, wide = "big" if head[5] == 2 else "little", head[4] == 2
    start = int.from_bytes(head[40:48] if wide else head[32:36], order)
    size, count = (int.from_bytes(head[k : k + 2], order) for k in ((58, 60) if wide else (46, 48)))
    return start + size * count > library.stat().st_size


# -- what was learnt -------------------------------------------------------------------------------------------------------------

_useless: dict[Compiler, CompileError] = {}
"""Compilers that do not compile anything, and what they did instead."""

_refused: dict[Compiler, frozenset[str]] = {}
"""Optional flags that a compiler does not know."""


def useless(compiler: Compiler) -> CompileError | None:
    """What a compiler did that was found not to compile anything, in this process; None for any other."""
    return _useless.get(compiler)


def accepted(compiler: Compiler, flags: tuple[str, ...]) -> tuple[str, ...]:
    """Flags without those that a compiler was found to refuse in this process."""
    return tuple(flag for flag in flags if flag not in _refused.get(compiler, ()))


def examine(compiler: Compiler, flags: tuple[str, ...], failure: CompileError) -> tuple[str, ...]:
    """Find out why a compiler failed, with sources that every compiler takes: the flags that it refuses and can do without.

    Nothing if it compiles nothing at all, or if it was the sources' fault.
    """
    if _fails(compiler, ()):
        _useless[compiler] = failure
        return ()
    refused = tuple(flag for flag in flags if flag in OPTIONAL and _fails(compiler, (flag,)))
    _refused[compiler] = _refused.get(compiler, frozenset()).union(refused)
    return refused


@cache
def _fails(compiler: Compiler, flags: tuple[str, ...]) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        try:
            make_library(Path(folder), Recipe(PROBE, compiler, ("-fPIC", "-shared", *flags)))
        except (CompileError, OSError):
            return True
    return False
