"""What code on pages and in notebooks imports from ncgen is there."""

from __future__ import annotations

import ast
import importlib.util
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "docs").rglob("*.ipynb"))]
IMPORT = re.compile(r"^\s*from (ncgen[\w.]*) import (\(.*?\)|[^\n]*)", re.MULTILINE | re.DOTALL)


def text_of(page: Path) -> str:
    """The page; of a notebook its cells."""
    text = page.read_text(encoding="utf-8")
    return "\n".join("".join(cell["source"]) for cell in json.loads(text)["cells"]) if page.suffix == ".ipynb" else text


def imported(text: str) -> set[tuple[str, str]]:
    """(module, name) of every import from ncgen."""
    statements = [ast.parse(f"from {module} import {names.strip()}").body[0] for module, names in IMPORT.findall(text)]
    return {(found.module, alias.name) for found in statements for alias in found.names}


def is_there(module: str, name: str) -> bool:
    """Is it a name of the module, or a module of the package?"""
    found = importlib.import_module(module)
    return hasattr(found, name) or (hasattr(found, "__path__") and importlib.util.find_spec(f"{module}.{name}") is not None)


def missing(text: str) -> list[tuple[str, str]]:
    return sorted(place for place in imported(text) if not is_there(*place))


@pytest.mark.parametrize("page", [page for page in PAGES if "from ncgen" in text_of(page)], ids=lambda page: page.name)
def test_what_a_page_imports_is_there(page):
    assert missing(text_of(page)) == []


def test_the_check_sees_what_is_gone():
    text = "from ncgen.solver.positions.rank import (\n    freedom,\n    no_such_function,\n)\nfrom ncgen import load\n"
    assert missing(text) == [("ncgen.solver.positions.rank", "no_such_function")]
