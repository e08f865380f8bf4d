"""A name stands for one thing: no two modules and no two classes share one, but for those that are listed."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "ncgen"

MODULES = {
    "actions", "arguments", "batch", "conditions", "curves", "expressions", "files", "folder", "functions", "joint_loops",
    "joint_space", "labels", "layout", "outputs", "rates", "running", "runtime", "spelling", "start", "tables", "tangents",
    "variants", "written",
}  # fmt: skip
"""Names that several modules still have; the list may only become shorter."""

CLASSES = {
    "Bound", "Call", "Choice", "Deferred", "Drawing", "Function", "Functions", "Inertia", "Input", "Instant", "Link", "Moved",
    "Names", "Output", "Part", "Pieces", "Reference", "Start", "State", "States", "Stop", "Term", "Tolerances", "TreePlace",
    "Watched",
}  # fmt: skip
"""Names that several classes still have; the list may only become shorter."""


def shared(names: list[str]) -> set[str]:
    """Names that come more than once."""
    return {name for name, count in Counter(names).items() if count > 1}


def classes(source: str) -> list[str]:
    """Names of the classes of a module, those within others and within functions among them, but for private ones."""
    found = [node.name for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef)]
    return [name for name in found if not name.startswith("_")]


def test_modules_have_names_of_their_own():
    assert shared([path.stem for path in PACKAGE.rglob("*.py") if path.stem != "__init__"]) == MODULES


def test_classes_have_names_of_their_own():
    assert shared([name for path in PACKAGE.rglob("*.py") for name in classes(path.read_text(encoding="utf-8"))]) == CLASSES
