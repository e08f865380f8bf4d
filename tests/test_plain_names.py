"""Names say what they name: constants are quantities, and variables what they hold; in Python, C, templates and JavaScript."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from terms import misused

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "ncgen"

ADJECTIVES = {
    "ABANDONED", "AGREES", "AHEAD", "ALIKE", "ALONE", "ALONG", "ALWAYS", "APART", "AROUND", "ASIDE", "BAD", "BADLY", "BARELY",
    "BEFORE", "BELIEVED", "BESIDE", "BETTER", "BREAKING", "BROKEN", "CLEAR", "CLOSE", "CLOSED", "CREEP", "DEAD", "DEEPEST", "DRAWN",
    "ENOUGH", "EVERY", "EXACT", "FAR", "FARTHEST", "FEWEST", "FINEST", "FIRM", "FLAT", "FULL", "GONE", "HEAVIEST", "HELD",
    "IMPOSSIBLE", "KEPT", "LARGE", "LARGEST", "LEAST", "LIGHTEST", "LONG", "LONGEST", "LOST", "MANY", "MEANT", "MORE", "MOST",
    "NAMED", "NARROW", "NARROWEST", "NEAR", "NEARBY", "NEAREST", "NEARLY", "NEEDLESS", "NOISE", "NOISY", "NOTHING", "NOTICEABLE",
    "OFF", "OFTEN", "ONCE", "OPEN", "ORDINARY", "OTHERS", "OWN", "PATIENCE", "PLAIN", "POOR", "QUICK", "QUICKEST", "REACHED",
    "ROOM", "ROOMY", "SAME", "SHORT", "SHORTER", "SHORTEST", "SHOWN", "SLOW", "SMALL", "SMALLEST", "STANDSTILL", "STEADY", "STIFF",
    "STILL", "TALL", "TELLS", "TIGHT", "TINY", "TOGETHER", "TOLD", "TRIES", "UNCUT", "UNDONE", "UNSAID", "UNSEEN", "UNTAPED",
    "UNUSED", "USUAL", "VANISHING", "WAITING", "WANTED", "WATCHED", "WELL", "WHOLE", "WIDE", "WORST", "WORTHWHILE", "WRITTEN",
}  # fmt: skip
"""Words that do not say what a constant measures; write the quantity, such as MIN_SINGULAR_VALUE."""

VAGUE = {"found", "told", "said", "asked", "heard", "settled"}
"""Names of variables that do not say what they hold."""

VAGUE_IN_PYTHON = VAGUE | {
    "anything", "everything", "given", "its", "mine", "own", "part", "place", "places", "says", "share", "something", "stuff", "theirs",
    "thing", "things", "what",
}  # fmt: skip
"""The same in Python, where pronouns and words for whatever is somewhere stand for variables, too: write position, index, argument, kind,
fraction, …"""


def assigned(tree: ast.Module) -> set[str]:
    """Names that a module assigns on its top level."""
    targets = [
        node.targets if isinstance(node, ast.Assign) else [node.target]
        for node in tree.body
        if isinstance(node, (ast.Assign, ast.AnnAssign))
    ]
    return {name.id for group in targets for target in group for name in ast.walk(target) if isinstance(name, ast.Name)}


def local(tree: ast.Module) -> set[str]:
    """Names of variables and arguments anywhere in a module."""
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    return names | {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}


def test_names_say_what_they_name():
    wrong = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        name, tree = path.relative_to(PACKAGE).as_posix(), ast.parse(path.read_text(encoding="utf-8"))
        if names := (assigned(tree) & ADJECTIVES) | (local(tree) & VAGUE_IN_PYTHON):
            wrong[name] = names
    assert wrong == {}


def test_the_check_sees_such_names():
    tree = ast.parse("LARGEST = 3\ndef f(asked):\n    found = asked\n")
    assert assigned(tree) & ADJECTIVES == {"LARGEST"} and local(tree) & VAGUE == {"found", "asked"}


CODE = ("c", "h", "hpp", "js", "ts", "py")
"""Languages of sources and templates other than the package's Python."""

DIALECT = VAGUE | {
    "apart", "beside", "careful", "looked", "looks", "patience", "settle", "slope", "slopes", "tell", "tells",
    "weighed",
}  # fmt: skip
"""Parts of identifiers for which the field has other words (`terms.py`, docs/renamed.md)."""


def sources() -> list[Path]:
    """The C library, other C of the package, templates and scripts."""
    files = [*PACKAGE.rglob("*.[ch]"), *(ROOT / "templates").rglob("*.*")]
    return sorted(path for path in files if set(path.suffixes) & {".c", ".h", ".hpp", ".js", ".ts", ".jinja"})


def comments_and_code(path: Path) -> tuple[str, str]:
    """Comments, and the rest without texts in quotes; of prose (pages, READMEs) all counts as comments."""
    text = path.read_text(encoding="utf-8")
    if not any(f".{language}" in path.suffixes for language in CODE):
        return text, ""
    parts = re.compile(r"(?P<comment>/\*.*?\*/|\{#.*?#\}|(?<![:\w])//[^\n]*|\"\"\".*?\"\"\")|\"(?:\\\\.|[^\"\\\\\n])*\"", re.DOTALL)
    return " ".join(match["comment"] for match in parts.finditer(text) if match["comment"]), parts.sub(" ", text)


def dialect_in(code: str) -> set[str]:
    """Identifiers of which a part is in `DIALECT`."""
    names = set(re.findall(r"[A-Za-z_]\w*", code))
    return {name for name in names if {part.lower() for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)} & DIALECT}


@pytest.mark.parametrize("path", sources(), ids=lambda path: str(path.relative_to(ROOT)))
def test_sources_and_templates_use_the_terms_of_the_field(path):
    comments, code = comments_and_code(path)
    assert misused(comments) == [] and dialect_in(code) == set()


def test_the_check_sees_dialect(tmp_path):
    source = tmp_path / "a.c"
    source.write_text('/* beside a wall */ int row_looks = 1; f("told");\n// goes on\nint slopes;\n')
    comments, code = comments_and_code(source)
    assert len(misused(comments)) == 2 and dialect_in(code) == {"row_looks", "slopes"}
