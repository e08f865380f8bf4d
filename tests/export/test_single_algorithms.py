"""Templates and scripts compute nothing that the runtime computes: their code has none of the words of integrators, iterations and
factorisations, but where an exception is listed with its reason."""

from __future__ import annotations

import re

from ncgen.resources import folder

WORDS = (
    "runge", "newton", "euler", "eliminat", "factored", "factori", "pivot", "cholesky", "householder", "saddle", "dop853", "dopri", "rk4",
    "radau", "rattle", "broyden", "gauss", "solve", "tableau",
)  # fmt: skip

REASONS = {
    "editor/editor.js": {"pivot": "a joint"},
    "editor/hands.js": {"pivot": "a joint"},
    "editor/motion.js": {"pivot": "a message of the runtime"},
    "package/wasm/wrapper.js.jinja": {"factori": "a message of the runtime"},
    "package/html/page.html.jinja": {"runge": "the name of a choice"},
    "c/dynamics.c.jinja": {"newton": "the name of an emitted program"},
    "c/recursion.c.jinja": {"newton": "the name of an emitted program"},
    "c/ncgen_tableaus.h.jinja": {"tableau": "the data of the runtime's explicit methods"},
    "package/motion.c.jinja": {
        "eliminat": "the plan by which the runtime eliminates, as data",
        "factori": "a message of the runtime",
    },
    "package/dynamics.c.jinja": {"eliminat": "the plan by which the runtime eliminates, as data"},
    "package/joints/joints.c.jinja": {"solve": "calls of the runtime's solution, in headers that come with the file"},
}
"""{file: {word: why it may be in its code}}."""

COMMENT = re.compile(r"/\*.*?\*/|\{#.*?#\}|(?<![:\"'`])//[^\n]*", re.DOTALL)


def words_of(text: str) -> set[str]:
    """The words that a text has outside of comments."""
    code = COMMENT.sub("", text).lower()
    return {word for word in WORDS if word in code}


def test_no_template_has_an_algorithm_of_its_own():
    root = folder("templates")
    files = [path for path in sorted(root.rglob("*")) if path.is_file() and not path.name.startswith("README")]
    found = {path.relative_to(root).as_posix(): words_of(path.read_text(encoding="utf-8")) for path in files}
    assert {name: words for name, words in found.items() if words} == {name: set(reasons) for name, reasons in REASONS.items()}


def test_the_check_sees_code_and_no_comment():
    assert words_of("// Newton\n/* pivot */ let x = runge(1);") == {"runge"}
