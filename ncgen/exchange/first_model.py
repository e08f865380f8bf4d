"""A model file to begin with: a small mechanism whose comments say what a file can say."""

from __future__ import annotations

import re
from pathlib import Path
from textwrap import wrap

from ncgen.emit.environment import render
from ncgen.errors import ModelError
from ncgen.exchange.words import is_required, signature_of, words
from ncgen.files import write_text
from ncgen.model import Model

WIDTH = 120
"""Characters of a line of comments."""


def write_start(path: Path) -> Path:
    """Write the file and return its path. Raises ModelError where there is one already, and for a name that no model can have."""
    if path.suffix != ".toml":
        raise ModelError(f"{path}: a model file ends in .toml; write {path.with_suffix('.toml').name}")
    text = start_text(path.name)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.open("x").close()  # the name is taken in one step, so that two who write at once do not undo each other
    except FileExistsError:
        raise ModelError(f"{path}: the file exists; choose another name") from None
    try:
        return write_text(path, text)
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def start_text(file: str) -> str:
    """The text for a file of that name, after which the model is called. Raises ModelError for a name that no model can have."""
    name = Model(re.sub(r"[^\w.]", "_", Path(file).stem)).name
    vocabulary = [line for word in words() for line in _described(word)]
    return render("toml/start.toml.jinja", name=name, file=file, vocabulary=vocabulary)


def _described(word: str) -> list[str]:
    """A table's header, what it says and its keys, in lines."""
    keys = [p.name if is_required(p) else f"[{p.name}]" for p in signature_of(word).parameters.values()]
    meaning = " ".join((getattr(Model, word).__doc__ or "").strip().partition("\n\n")[0].split())
    return wrap(f"[[{word}]] {', '.join(keys)}: {meaning}", WIDTH, subsequent_indent="    ", break_on_hyphens=False)
