"""What a fault is, and all that can be planted in a source of Python or C.

A fault is one small change: a comparison turned round, or off by one where it counts something; another operation; a number one greater, or
of the other sign; a condition or a statement left out. Left alone is what no test could or should see: annotations, docstrings and
comments; `__repr__`; what stands in a message that is raised or warned of, and where a warning points; assertions, which say what is so
anyway; and the numbers that only limit (LIMITS): how often something is tried, how much is kept, how long is waited.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

LIMITS = r"\w*(?:LIMIT|MOST|PATIENCE|LARGEST|LONGEST)\w*"
"""Names of constants that only limit."""


@dataclass(frozen=True)
class Fault:
    """A change of `length` characters from `start` on, in a file given relative to the repository."""

    room: str
    file: str
    line: int
    start: int
    length: int
    new: str

    def planted(self, text: str) -> str:
        """The source with the fault."""
        return text[: self.start] + self.new + text[self.start + self.length :]

    @cached_property
    def change(self) -> str:
        """The lines of the source with the fault marked «old→new»: what it is known by where lines move."""
        text = (ROOT / self.file).read_text(encoding="utf-8")
        end = self.start + self.length
        before, after = text[: self.start].rpartition("\n")[2], text[end:].partition("\n")[0]
        return " ".join(f"{before}«{text[self.start : end]}→{self.new}»{after}".split())

    def __str__(self) -> str:
        return f"{self.file}:{self.line}  {self.change}"


BOUNDED = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
"""Off by one, where whole numbers are compared; between others nobody could see it."""

COMPARED = {"<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "=="}
COMBINED = {"+": "-", "-": "+", "*": "/", "/": "*", "and": "or", "or": "and", "&&": "||", "||": "&&"}


def python_faults(text: str) -> Iterator[tuple[int, int, str]]:
    """(start, length, new text) of everything that can be changed in a Python source."""
    lines = text.splitlines(keepends=True)
    begins = [0]
    for line in lines:
        begins.append(begins[-1] + len(line))

    def place(line: int, byte: int) -> int:
        return begins[line - 1] + len(lines[line - 1].encode()[:byte].decode())

    def span(node: ast.expr | ast.stmt) -> tuple[int, int]:
        start = place(node.lineno, node.col_offset)
        return start, place(node.end_lineno or node.lineno, node.end_col_offset or 0) - start

    def between(left: ast.expr, right: ast.expr, table: dict[str, str]) -> Iterator[tuple[int, int, str]]:
        first = sum(span(left))
        found = re.search(r"\b(?:and|or)\b|[<>=!]=|[<>]|\*\*|//|[-+*/]", text[first : span(right)[0]])
        if found and found[0] in table:
            yield first + found.start(), len(found[0]), table[found[0]]

    for node in _evaluated(ast.parse(text)):
        if isinstance(node, ast.Compare):
            yield from between(node.left, node.comparators[0], BOUNDED if _counts(node) else COMPARED)
        elif isinstance(node, ast.BinOp):
            yield from between(node.left, node.right, COMBINED)
        elif isinstance(node, ast.BoolOp):
            yield from between(node.values[0], node.values[1], COMBINED)
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            yield (*span(node), _other(node.value))
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)):
            start, _ = span(node)
            yield start, span(node.operand)[0] - start, ""
        elif isinstance(node, (ast.AugAssign, ast.Expr)) and not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            yield (*span(node), "pass")


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
    """Nodes that are computed when the code runs and that do more than say something to people."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        waiting += [child for name, child in _parts(node) if name not in ("annotation", "returns") and not _is_apart(child)]


def _parts(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """(field, node) of all that stands right below a node; of a warning or what is raised, nothing."""
    if isinstance(node, ast.Raise) or isinstance(node, ast.Call) and ast.unparse(node.func) in ("warnings.warn", "warn"):
        return
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield name, child


def _is_apart(node: ast.AST) -> bool:
    """Whether nothing below a node is to be changed."""
    if isinstance(node, ast.If):
        return "TYPE_CHECKING" in ast.unparse(node.test)
    if isinstance(node, ast.FunctionDef):
        return node.name == "__repr__"
    if isinstance(node, ast.Assign):
        return bool(re.fullmatch(LIMITS, ast.unparse(node.targets[0])))
    return isinstance(node, ast.Assert)


C_APART = re.compile(rf'/\*.*?\*/|"[^"\n]*"|^#(?:[^\n]*\\\n)*[^\n]*$|\b{LIMITS} = \d+', re.DOTALL | re.MULTILINE)
"""Comments, texts, lines of the preprocessor and limits."""

C_TOKEN = re.compile(r"&&|\|\||[<>=!]=|(?<=[\w\])] )[-+*/<>](?= )|\b\d+(?:\.\d+)?(?:e-?\d+)?\b")


def c_faults(text: str) -> Iterator[tuple[int, int, str]]:
    """(start, length, new text) of everything that can be changed in a C source."""
    hidden = C_APART.sub(lambda found: re.sub(r"\S", " ", found[0]), text)
    for found in C_TOKEN.finditer(hidden):
        token = found[0]
        if token in COMPARED:
            line = hidden[hidden.rfind("\n", 0, found.start()) + 1 : found.end()]
            yield found.start(), len(token), (BOUNDED if "for (" in line else COMPARED)[token]
        elif token in COMBINED:
            yield found.start(), len(token), COMBINED[token]
        elif token[0].isdigit():
            yield found.start(), len(token), _other(int(token) if token.isdigit() else float(token))


def faults(room: str) -> list[Fault]:
    """All faults of a room, a package of ncgen, in the order of its files."""
    found = []
    for path in sorted((ROOT / "ncgen" / room).rglob("*.[pc]*")):
        if path.suffix in (".py", ".c"):
            text = path.read_text(encoding="utf-8")
            for start, length, new in python_faults(text) if path.suffix == ".py" else c_faults(text):
                found.append(Fault(room, str(path.relative_to(ROOT)), text[:start].count("\n") + 1, start, length, new))
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
