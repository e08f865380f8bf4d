"""Pages that the program knows by heart: every word of model files, every public function, every method, every example."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import gallery
import griffe
from docstrings import SECTION, tabled

import ncgen
from ncgen.exchange.file_arguments import CONVERSIONS
from ncgen.exchange.words import head, is_required, kind_of, signature_of, words
from ncgen.methods.table import FORMALISMS, INTEGRATORS, partners
from ncgen.model import Model

ASIDE = "docs/reference"
"""The folder of these pages."""


def pages() -> dict[str, str]:
    """{path in the site: Markdown}"""
    own = {"words": vocabulary(), "methods": methods(), "modules": modules()}
    return {f"{ASIDE}/{name}.md": text for name, text in own.items()} | interface() | {"examples/README.md": gallery.page()}


# -- words of model files ------------------------------------------------------------------------------------------------------------------


def vocabulary() -> str:
    """Every table that a model file can have, with its keys."""
    parts = [
        "# Words of model files",
        "A table `[[word]]` in a TOML file is a call of the builder's method of that name, and its keys are the method's arguments; so "
        "this page holds for Python as well. `ncgen check FILE.toml` says what is wrong with a file, `ncgen new FILE.toml` writes one to "
        "begin with. [Describing a mechanism](../models.md) tells how the words are put together.",
        "## At the top of a file",
        _keys(head()),
    ]
    for part in reversed(Model.__mro__):
        own = [word for word in words() if word in vars(part)]
        if own:
            parts += ["## Drawings and runs" if part is Model else f"## {part.__name__}", *(text for word in own for text in _word(word))]
    return "\n\n".join([*parts, "## What keys can be", *_kinds()]) + "\n"


def _word(word: str) -> Iterator[str]:
    yield f"### `[[{word}]]`" if word != "simulation" else "### `[simulation]`"
    text = inspect.getdoc(getattr(Model, word)) or ""
    yield tabled(text) if SECTION.search(text) else text
    yield _keys(signature_of(word))


def _keys(signature: inspect.Signature) -> str:
    rows = [f"| `{p.name}` | [{kind_of(p)}](#{_anchor(kind_of(p))}) | {_default(p)} |" for p in signature.parameters.values()]
    return "\n".join(["| key | what it is | where it is left out |", "|---|---|---|", *rows])


def _default(parameter: inspect.Parameter) -> str:
    if is_required(parameter):
        return "it is needed"
    if parameter.default in (None, (), parameter.empty):
        return ""
    return f"`{str(parameter.default).lower() if isinstance(parameter.default, bool) else parameter.default!r}`"


def _anchor(kind: str) -> str:
    return "kind-" + "".join(letter if letter.isalnum() else "-" for letter in kind.lower()).strip("-")


def _kinds() -> Iterator[str]:
    """What a value can be, kinds that are said alike together."""
    for conversion in dict.fromkeys(CONVERSIONS.values()):
        alike = [f"**{kind}**{{ #{_anchor(kind)} }}" for kind, other in CONVERSIONS.items() if other is conversion]
        yield f"- {', '.join(alike)}: {inspect.getdoc(conversion)}"


# -- methods -------------------------------------------------------------------------------------------------------------------------------


def methods() -> str:
    """Every formalism and integrator with what goes with it."""
    parts = ["# Table of methods", "This page lists all methods. [Choosing a method](../methods.md) helps to choose one."]
    for title, table in (("Formalisms", FORMALISMS), ("Integrators", INTEGRATORS)):
        rows = [f"| `{entry.name}` | {entry.help}{_also(entry)} | {_partners(entry)} |" for entry in table.values()]
        parts += [f"## {title}", "\n".join(["| name | what it is | goes with |", "|---|---|---|", *rows])]
    return "\n\n".join(parts) + "\n"


def _also(entry: object) -> str:
    also = getattr(entry, "also", ())
    return f"; also called {', '.join(f'`{name}`' for name in also)}" if also else ""


def _partners(entry) -> str:
    return ", ".join(f"`{name}`" for name in partners(entry))


# -- modules -------------------------------------------------------------------------------------------------------------------------------


def modules() -> str:
    """Every module of the program with the first sentence of its own text, room by room."""
    root = Path(ncgen.__file__).parent
    parts = ["# Modules", "How they go together is said in [How ncgen is built](../architecture.md)."]
    for folder in sorted(path.parent for path in root.rglob("__init__.py")):  # the examples beside them are none
        inside = [(path.stem, _first_words(path)) for path in sorted(folder.glob("*.py")) if path.stem != "__init__"]
        if inside:
            name, text = ".".join(("ncgen", *folder.relative_to(root).parts)), _first_words(folder / "__init__.py")
            rows = [f"| `{stem}` | {words} |" for stem, words in inside]
            parts += [f"## {name}", text, "\n".join(["| module | what it is |", "|---|---|", *rows])]
    return "\n\n".join(parts) + "\n"


def _first_words(path: Path) -> str:
    """The first paragraph of a module's docstring on one line, as the cell of a table; matrices in brackets are no links."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split()).replace("|", "\\|").replace("[", "&#91;")


# -- functions -----------------------------------------------------------------------------------------------------------------------------


def interface() -> dict[str, str]:
    """A page for every public name, with the classes of what it returns where no other page has them."""
    known: dict[str, str] = {}
    for name in sorted(ncgen.__all__, key=lambda name: len(_returned(name))):
        for path in _returned(name):
            known.setdefault(path, name)
    return {f"{ASIDE}/ncgen/{name}.md": _of_name(name, [path for path, home in known.items() if home == name]) for name in ncgen.__all__}


def _of_name(name: str, classes: list[str]) -> str:
    parts = [f"# ncgen.{name}", f"::: {ncgen._HOMES[name]}.{name}"]
    return "\n\n".join([*parts, *(f"::: {path}" for path in classes)]) + "\n"


def _returned(name: str) -> list[str]:
    """Paths of the classes of the program that a function returns."""
    target = _package()[f"{ncgen._HOMES[name]}.{name}".removeprefix("ncgen.")]
    target = target.final_target if target.is_alias else target
    if not target.is_function or target.returns is None:
        return []
    names = (part for part in target.returns.iterate(flat=True) if isinstance(part, griffe.ExprName))
    public = {f"{ncgen._HOMES[other]}.{other}" for other in ncgen.__all__}
    return [path for part in names if (path := part.canonical_path).startswith("ncgen.") and path not in public]


@cache
def _package() -> griffe.Object | griffe.Alias:
    return griffe.load("ncgen")
