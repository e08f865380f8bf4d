"""Every message of ncgen in one list: errors, warnings and help of the command line, written to docs/reports/messages.txt.

    python docs/messages.py

Expressions stand in braces as in the code. Lines are sorted by module, within a module in the order of the code.
"""

from __future__ import annotations

import ast
import builtins
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
REPORT = ROOT / "docs" / "reports" / "messages.txt"

WARNINGS = ("warn", "_warn", "refuse")
"""Functions, and methods of readers of files, that are given a message."""


def messages() -> list[str]:
    """Return all messages as lines `module: kind: message`."""
    found = []
    for path in sorted((ROOT / "ncgen").rglob("*.py")):
        module = path.relative_to(ROOT / "ncgen").with_suffix("").as_posix()
        found += [f"{module}: {kind}: {text}" for kind, text in of_module(ast.parse(path.read_text(encoding="utf-8")))]
    return found + [f"help: {text}" for text in of_help()]


def of_module(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Yield (kind, message) of all errors that are made and warnings that are given in a module."""
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and node.args]
    for call in sorted(calls, key=lambda node: (node.lineno, node.col_offset)):
        name = call.func.attr if isinstance(call.func, ast.Attribute) else call.func.id if isinstance(call.func, ast.Name) else ""
        is_error = name.endswith("Error") and not hasattr(builtins, name)
        if (is_error or name in WARNINGS) and (text := template(call.args[0])):
            yield ("warning" if name in ("warn", "_warn") else name), text


def template(node: ast.expr) -> str:
    """Return a text or an f-string with its expressions in braces; "" for what is neither."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "{" + ast.unparse(part.value) + "}" for part in node.values)
    return ""


def of_help() -> Iterator[str]:
    """Yield what `ncgen COMMAND --help` says of commands and their options."""
    import typer

    from ncgen.cli import app

    for name, command in sorted(typer.main.get_command(app).commands.items()):
        yield f"{name}: {' '.join((command.help or '').split())}"
        for parameter in command.params:
            if text := getattr(parameter, "help", None):
                yield f"{name} {parameter.opts[0]}: {' '.join(text.split())}"


if __name__ == "__main__":
    REPORT.write_text("\n".join(messages()) + "\n", encoding="utf-8")
    print(f"{REPORT.relative_to(ROOT)}: {len(messages())} messages")
