"""Faults planted one at a time, and whether the tests notice.

    python -m pytest --cov=ncgen --cov-context=test     # once: which test runs which line, in .coverage
    python tests/mutation/plant.py COUNT [SEED] [--room program emit solver runtime] [--seconds 100] [--again LOG]

A fault is one small change of a source: a comparison turned round, or off by one where it counts something; another operation; a number one
greater, or of the other sign; a condition or a statement left out. It is made in a copy of the repository, where tests run until one fails
or the seconds of the processor are over: of a fault in Python those that run its line, the shortest first, of one in C those of the
runtime, the files first that mention its module. A test that does not end (`endless.py`) notices, too; what is not noticed by then counts
as a survivor, so the rate that is printed is a lower bound. Printed is a line a fault as it is decided, with what noticed it, and at the
end how many of each room were caught. A seed gives the same faults as long as the sources are the same; --again plants only those that
survived in the output of such a run, to give their tests more time. Some faults change nothing that anybody could see (a limit, a faster
way to the same result); they count as survivors, too.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from coverage import CoverageData

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 600
"""Seconds, beside ten times those of the processor, after which tests wait for something that never comes: they notice the fault."""

REACH, MOST = 6, 150
"""Lines before a fault at which its statement may begin; tests that are run at most."""

ROOMS = ("program", "emit", "solver", "runtime")

OF_C = ("tests/runtime", "tests/solver", "tests/hard")
"""Where tests of the runtime are, of which no coverage is measured."""

CALLED = {
    "adjoint": "gradient", "directions": "sensitivities", "driven": "inputs", "motions": "gradient_batch", "space": "joint_space",
    "partitioning": "coordinate-partitioning", "constrained": "lagrange", "tree": "tables",
}  # fmt: skip
"""What users call what a module of the runtime does, where that is not its name."""


@dataclass(frozen=True)
class Fault:
    """A change of `length` characters from `start` on, in a file given relative to the repository."""

    room: str
    file: str
    line: int
    start: int
    length: int
    new: str
    kind: str

    def planted(self, text: str) -> str:
        """The source with the fault."""
        return text[: self.start] + self.new + text[self.start + self.length :]


BOUNDED = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
"""Off by one, where whole numbers are compared; between others nobody could see it."""

COMPARED = {"<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "=="}
COMBINED = {"+": "-", "-": "+", "*": "/", "/": "*", "and": "or", "or": "and", "&&": "||", "||": "&&"}


def python_faults(text: str) -> Iterator[tuple[int, int, str, str]]:
    """(start, length, new text, kind) of everything that can be changed in a Python source; annotations and texts are left alone."""
    lines = text.splitlines(keepends=True)
    begins = [0]
    for line in lines:
        begins.append(begins[-1] + len(line))

    def place(line: int, byte: int) -> int:
        return begins[line - 1] + len(lines[line - 1].encode()[:byte].decode())

    def span(node: ast.expr | ast.stmt) -> tuple[int, int]:
        start = place(node.lineno, node.col_offset)
        return start, place(node.end_lineno or node.lineno, node.end_col_offset or 0) - start

    def between(left: ast.expr, right: ast.expr, table: dict[str, str], kind: str) -> Iterator[tuple[int, int, str, str]]:
        first = sum(span(left))
        found = re.search(r"\b(?:and|or)\b|[<>=!]=|[<>]|\*\*|//|[-+*/]", text[first : span(right)[0]])
        if found and found[0] in table:
            yield first + found.start(), len(found[0]), table[found[0]], kind

    for node in _evaluated(ast.parse(text)):
        if isinstance(node, ast.Compare):
            yield from between(node.left, node.comparators[0], BOUNDED if _counts(node) else COMPARED, "comparison")
        elif isinstance(node, ast.BinOp):
            yield from between(node.left, node.right, COMBINED, "operation")
        elif isinstance(node, ast.BoolOp):
            yield from between(node.values[0], node.values[1], COMBINED, "condition")
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            yield (*span(node), _other(node.value), "number")
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)):
            start, _ = span(node)
            yield start, span(node.operand)[0] - start, "", "sign"
        elif isinstance(node, (ast.AugAssign, ast.Expr)) and not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            yield (*span(node), "pass", "statement")


def _counts(compared: ast.Compare) -> bool:
    """Whether a comparison is with a whole number or the length of something."""
    sides = (compared.left, *compared.comparators)
    return any(
        isinstance(side, ast.Constant)
        and type(side.value) is int
        or isinstance(side, ast.Call)
        and isinstance(side.func, ast.Name)
        and side.func.id == "len"
        for side in sides
    )


def _other(value: float) -> str:
    """Another number: a whole one is one greater, others have the other sign."""
    return repr(value + 1 if isinstance(value, int) else -value or 1.0)


def _evaluated(tree: ast.AST) -> Iterator[ast.AST]:
    """Nodes that are computed when the code runs: not annotations, not what only a type checker sees, not what must be so anyway."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for name, value in ast.iter_fields(node):
            if (
                name in ("annotation", "returns")
                or isinstance(node, ast.Assert)
                or (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test))
            ):
                continue
            waiting += [child for child in (value if isinstance(value, list) else [value]) if isinstance(child, ast.AST)]


C_TOKEN = re.compile(r"&&|\|\||[<>=!]=|(?<=[\w\])] )[-+*/<>](?= )|\b\d+(?:\.\d+)?(?:e-?\d+)?\b")


def c_faults(text: str) -> Iterator[tuple[int, int, str, str]]:
    """The same of a C source, comments, texts and lines of the preprocessor apart."""
    hidden = re.sub(r'/\*.*?\*/|"[^"\n]*"|^#(?:[^\n]*\\\n)*[^\n]*$', lambda found: re.sub(r"\S", " ", found[0]), text, flags=re.S | re.M)
    for found in C_TOKEN.finditer(hidden):
        token = found[0]
        if token in COMPARED:
            line = hidden[hidden.rfind("\n", 0, found.start()) + 1 : found.end()]
            yield found.start(), len(token), (BOUNDED if "for (" in line else COMPARED)[token], "comparison"
        elif token in COMBINED:
            yield found.start(), len(token), COMBINED[token], "operation"
        elif token[0].isdigit():
            yield found.start(), len(token), _other(int(token) if token.isdigit() else float(token)), "number"


def faults(room: str) -> list[Fault]:
    """All faults of a room, in the order of its files."""
    found = []
    for path in sorted((ROOT / "ncgen" / room).rglob("*.[pch]*")):
        if path.suffix not in (".py", ".c"):
            continue
        text = path.read_text(encoding="utf-8")
        for start, length, new, kind in python_faults(text) if path.suffix == ".py" else c_faults(text):
            found.append(Fault(room, str(path.relative_to(ROOT)), text[:start].count("\n") + 1, start, length, new, kind))
    return found


def is_source(fault: Fault) -> bool:
    """Whether a source with the fault can still be read by Python; one that cannot would be noticed by anything."""
    if not fault.file.endswith(".py"):
        return True
    try:
        ast.parse(fault.planted((ROOT / fault.file).read_text(encoding="utf-8")))
    except SyntaxError:
        return False
    return True


class Reached:
    """Which tests run a line, by the coverage that a run of all tests has measured."""

    def __init__(self, file: Path) -> None:
        self.data = CoverageData(str(file))
        self.data.read()
        self.size = Counter(
            context
            for path in self.data.measured_files()
            for contexts in self.data.contexts_by_lineno(path).values()
            for context in contexts
        )

    def tests(self, fault: Fault) -> list[str]:
        """Those of a line, or of its module where an import runs it, which run the fewest other lines first; none where nothing runs it."""
        lines = self.data.contexts_by_lineno(str(ROOT / fault.file))
        # What stands on several lines is known by some of them.
        contexts = next((lines[line] for line in range(fault.line, fault.line - REACH, -1) if lines.get(line)), [])
        if not any(contexts):
            contexts = {context for line in lines.values() for context in line} if contexts else []
        found = {context.partition("|")[0]: self.size[context] for context in contexts if context}
        return sorted(found, key=lambda test: found[test])[:MOST]


def tests_of(fault: Fault, reached: Reached) -> list[str]:
    """What may notice a fault: the tests that run its line; of C those of the runtime, files that mention its module first."""
    if fault.file.endswith(".py"):
        return reached.tests(fault)
    stem = Path(fault.file).stem.removeprefix("ncgen_")
    word = re.escape(CALLED.get(stem, stem)).replace("_", "[-_]")
    counts = {
        path: -len(re.findall(rf"\b{word}\b", path.read_text(encoding="utf-8")))
        for place in OF_C
        for path in sorted((ROOT / place).rglob("test_*.py"))
    }
    likely = sorted(filter(counts.get, counts), key=lambda path: counts[path])
    return [*(str(path.relative_to(ROOT)) for path in likely), *OF_C]


def noticed_by(fault: Fault, copy: Path, seconds: int, tests: list[str]) -> str:
    """The test that fails on a copy of the repository with the fault, before `seconds` of the processor's time are over; or nothing."""
    if not tests:
        return ""
    path = copy / fault.file
    sound = path.read_text(encoding="utf-8")
    path.write_text(fault.planted(sound), encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", "-p", "endless", *tests]
    # One cache for all faults: what lies there is found by all that made it, so it belongs to sources without the fault or with it.
    cache = str(copy.parent / "cache")
    surroundings = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(copy), str(copy / "tests/mutation")]),
        "NCGEN_TEST_CACHE": cache,
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONDONTWRITEBYTECODE": "1",
    }

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))

    try:
        done = subprocess.run(
            command, cwd=copy, env=surroundings, capture_output=True, text=True, timeout=PATIENCE + 10 * seconds, preexec_fn=limit
        )
        if done.returncode in (0, -signal.SIGXCPU, -signal.SIGKILL):
            return ""
        failed = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.M)
        return failed[1] if failed else "a test that does not end" if done.returncode == -signal.SIGPROF else f"exit {done.returncode}"
    except subprocess.TimeoutExpired:
        return "a test that waits for something that never comes"
    finally:
        path.write_text(sound, encoding="utf-8")


def _once(faults: Iterable[Fault]) -> Iterator[Fault]:
    """Each the first time that it comes."""
    seen = set()
    for fault in faults:
        if fault not in seen:
            seen.add(fault)
            yield fault


def told(fault: Fault) -> str:
    """A fault in one line."""
    old = (ROOT / fault.file).read_text(encoding="utf-8")[fault.start : fault.start + fault.length]
    return f"{fault.file}:{fault.line} {fault.kind} {old!r} -> {fault.new!r}"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("count", type=int)
    asked.add_argument("seed", type=int, nargs="?", default=0)
    asked.add_argument("--room", nargs="+", choices=ROOMS, default=list(ROOMS))
    asked.add_argument("--seconds", type=int, default=100)
    asked.add_argument("--again", type=Path)
    given = asked.parse_args()
    reached = Reached(ROOT / ".coverage")
    chance = random.Random(given.seed)
    everything = {room: faults(room) for room in given.room}
    offered = (chance.choice(everything[room]) for room in iter(lambda: chance.choice(given.room), None))
    chosen = list(islice(_once(filter(is_source, offered)), given.count))
    if given.again:
        survivors = set(re.findall(r"^SURVIVED (.*)$", given.again.read_text(encoding="utf-8"), re.M))
        chosen = [fault for fault in chosen if told(fault) in survivors]
    tally: Counter[tuple[str, bool]] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "copy"
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".git", "__pycache__", "*-output"))
        for fault in chosen:
            by = noticed_by(fault, copy, given.seconds, tests_of(fault, reached))
            tally[fault.room, bool(by)] += 1
            print(f"caught   {told(fault)} by {by}" if by else f"SURVIVED {told(fault)}", flush=True)
    for room in given.room:
        caught, all_of_it = tally[room, True], tally[room, True] + tally[room, False]
        print(f"{room}: {caught} of {all_of_it} caught")
    caught = sum(count for (_, noticed), count in tally.items() if noticed)
    print(f"in all: {caught} of {len(chosen)}, {100 * caught / max(len(chosen), 1):.0f} %")


if __name__ == "__main__":
    main()
