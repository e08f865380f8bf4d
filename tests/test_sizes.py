"""Modules hold one idea and functions are short: at most 400 lines a module, 60 a function without its docstring."""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "ncgen"

MAX_MODULE = 400
MAX_FUNCTION = 60


def sources() -> list[Path]:
    return [path for path in sorted(PACKAGE.rglob("*.*")) if path.suffix in (".py", ".c", ".h")]


def functions_in_python(text: str) -> dict[str, int]:
    """{name: lines after the docstring} of functions and methods."""
    found: dict[str, int] = {}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            lines = (node.end_lineno or 0) - body[0].lineno + 1 if body else 0
            found[node.name] = max(lines, found.get(node.name, 0))
    return found


def functions_in_c(text: str) -> dict[str, int]:
    """{name: lines between the braces} of functions, whose braces stand alone in their lines."""
    found, name, start = {}, "", None
    for number, line in enumerate(text.splitlines()):
        if "(" in line and line[:1].isalpha():
            name = line.partition("(")[0].split()[-1].lstrip("*")
        elif line == "{":
            start = number
        elif line == "}" and start is not None:
            found[name], start = number - start - 1, None
    return found


def test_modules_hold_one_idea():
    long = {path.relative_to(PACKAGE).as_posix() for path in sources() if len(path.read_text(encoding="utf-8").splitlines()) > MAX_MODULE}
    assert long == set()


def test_functions_are_short():
    long = set()
    for path in sources():
        functions = (functions_in_python if path.suffix == ".py" else functions_in_c)(path.read_text(encoding="utf-8"))
        long |= {f"{path.relative_to(PACKAGE).as_posix()}: {name}" for name, lines in functions.items() if lines > MAX_FUNCTION}
    assert long == set()


def test_the_checks_count():
    assert functions_in_python('def f(a):\n    """It."""\n    b = a\n    return b\n') == {"f": 2}
    assert functions_in_c("/* It. */\nstatic double *f(int a,\n           int b)\n{\n    return 0;\n}\n") == {"f": 1}
