"""The architecture page names modules, functions and paths that there are."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "architecture.md"
FOLDERS = ("ncgen", "templates", "docs", "tests", "generated", "examples")
FILES = [path.relative_to(ROOT).as_posix() for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*")) if path.is_file()]
SOURCES = [
    name for name in FILES if name.endswith((".py", ".pyi", ".c", ".h", ".jinja", ".md")) and not name.startswith("docs/architecture")
]


def missing(page: str) -> list[str]:
    """Names between backticks of a page that are no file, and no word of any source."""
    quoted = set(re.findall(r"`([^`\n ]+)`", re.sub(r"```.*?```", "", page, flags=re.DOTALL)))
    paths = {name for name in quoted if "/" in name}
    words = {name.rstrip("()").rpartition(".")[2] for name in quoted - paths if re.fullmatch(r"[A-Za-z_][\w.]*(\(\))?", name)}
    known = {part for name in FILES for part in (*Path(name).parts, Path(name).stem)}
    unknown = words - known - {word for name in SOURCES for word in re.findall(r"\w+", (ROOT / name).read_text(encoding="utf-8"))}
    lost = [path for path in paths if not any(path.strip("/") in name for name in FILES)]
    return sorted([*unknown, *lost])


def test_the_page_names_what_there_is():
    assert missing(PAGE.read_text(encoding="utf-8")) == []


def test_the_check_sees_what_is_gone():
    assert missing("`ncgen/emit/gone.py` has `no_such_" + "function_at_all()` and `Model`") == [
        "ncgen/emit/gone.py",
        "no_such_" + "function_at_all",
    ]
