"""Names say what they name: constants are quantities, and variables what they hold."""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "ncgen"

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
        if names := (assigned(tree) & ADJECTIVES) | (local(tree) & VAGUE):
            wrong[name] = names
    assert wrong == {}


def test_the_check_sees_such_names():
    tree = ast.parse("LARGEST = 3\ndef f(asked):\n    found = asked\n")
    assert assigned(tree) & ADJECTIVES == {"LARGEST"} and local(tree) & VAGUE == {"found", "asked"}
