"""Write the signatures of public functions before and after their arguments were put in groups to docs/renamed.md.

    python docs/signatures.py

Both are read from sources, those before from the git history, so nothing is imported.
"""

from __future__ import annotations

import ast
import subprocess
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "renamed.md"
BEFORE = "41a70ace2c726e1c623ea1d5ad271fc287fe330b"
"""The commit before the groups."""
START, END = "<!-- python docs/signatures.py -->\n", "<!-- end of the table -->"


def then(path: str) -> str:
    """Return a file as it was before, "" where there was none."""
    return subprocess.run(["git", "show", f"{BEFORE}:{path}"], cwd=ROOT, capture_output=True, encoding="utf-8").stdout


def now(path: str) -> str:
    """Return a file as it is."""
    file = ROOT / path
    return file.read_text(encoding="utf-8") if file.exists() else ""


def homes(read: Callable[[str], str]) -> dict[str, str]:
    """Return {public name: its module}."""
    for node in ast.parse(read("ncgen/__init__.py")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "_HOMES" and isinstance(node.value, ast.Dict):
            return ast.literal_eval(node.value)
    lines = [line.split() for line in read("ncgen/__init__.pyi").splitlines() if line.startswith("from ")]
    return {words[5]: words[1] for words in lines}


def signature(read: Callable[[str], str], module: str, name: str) -> str:
    """Return the parameters of a function, without annotations; "" for what is no function."""
    path = module.replace(".", "/")
    for node in ast.parse(read(f"{path}.py") or read(f"{path}/__init__.py")).body:
        if isinstance(node, ast.FunctionDef) and node.name == name and "overload" not in map(ast.unparse, node.decorator_list):
            every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            kinds = [a.annotation for a in [node.args.kwarg] if a]
            star = [f"**{ast.unparse(kind.slice if isinstance(kind, ast.Subscript) else kind)}" for kind in kinds if kind]
            return ", ".join([*(a.arg for a in every), *star])
    return ""


def table() -> str:
    """Return a row for every public function whose parameters have changed, and the numbers of parameters."""
    rows = ["| function | before | now |", "|---|---|---|"]
    old = homes(then)
    for name, module in sorted(homes(now).items()):
        before, after = signature(then, old[name], name) if name in old else "", signature(now, module, name)
        if before != after:
            cells = (f"{len(text.split(', '))}: `{text}`" if text else "" for text in (before, after))
            rows.append(f"| `{name}` | {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    head, _, rest = text.partition(START)
    PAGE.write_text(f"{head}{START}\n{table()}\n{END}{rest.partition(END)[2]}", encoding="utf-8")
    print(f"{PAGE.relative_to(ROOT)}: {table().count(chr(10)) - 2} functions")
