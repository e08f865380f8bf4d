"""XML as a tree of elements that know their lines. Nothing in a file is fetched or expanded: entities and document types are refused."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn
from xml.parsers import expat

import numpy as np

from ncgen.errors import ModelError, shown
from ncgen.exchange.text import placed, text_of
from ncgen.model.arithmetic import norm, unit
from ncgen.model.values import MAX_NUMBER

MAX_DEPTH = 100
"""Elements inside each other."""

XACRO = ".xacro"
"""How files end that are URDF when their macros are expanded."""

PICTURES = ("visual", "collision")
"""Elements in which nothing stops the dynamics: a macro in them is a shape that is not seen."""

UNLIMITED = 1e15
"""Limits of joints beyond this are none."""


class Attributes(dict[str, str]):
    """An element's attributes, which know what of them has been read."""

    def __init__(self, pairs: Mapping[str, str]) -> None:
        super().__init__(pairs)
        self.read: set[str] = set()

    def __getitem__(self, name: str) -> str:
        self.read.add(name)
        return super().__getitem__(name)

    def get(self, name: str, default: Any = None) -> Any:
        """The text of an attribute, or the default."""
        self.read.add(name)
        return super().get(name, default)


@dataclass(eq=False, kw_only=True)
class Markup:
    """An element of a file. where: the file's name, for messages; raw: its text, which nobody has read yet unless `is_read`."""

    tag: str
    attributes: Attributes
    line: int
    where: str
    children: list[Markup] = field(default_factory=list)
    raw: str = ""
    is_read: bool = False

    @property
    def text(self) -> str:
        """The element's text, which counts as read from now on."""
        self.is_read = True
        return self.raw

    def all(self, tag: str) -> list[Markup]:
        """Its children of a kind."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> Markup | None:
        """Its first child of a kind, or None."""
        return next(iter(self.all(tag)), None)

    def only(self, tag: str) -> Markup:
        """Its first child of a kind. Raises ModelError where there is none."""
        child = self.first(tag)
        return child if child is not None else self.refuse(f"<{self.tag}> has no <{tag}>; give it one")

    def walk(self) -> Iterator[Markup]:
        """The element and all that is in it."""
        yield self
        for child in self.children:
            yield from child.walk()

    def name(self, attribute: str = "name") -> str:
        """An attribute that must be there and not be empty."""
        text = self.attributes.get(attribute, "").strip()
        return text or self.refuse(f'<{self.tag}> has no {attribute}; write <{self.tag} {attribute}="…">')

    def number(self, attribute: str, default: float | None = None) -> float:
        """A number in an attribute; without a default it must be there."""
        text = self.attributes.get(attribute)
        if text is None and default is not None:
            return default
        return self._number(self.name(attribute), attribute)

    def numbers(self, attribute: str, count: int, default: tuple[float, ...]) -> tuple[float, ...]:
        """So many numbers in an attribute, or the default."""
        text = self.attributes.get(attribute)
        return default if text is None else self._split(text, count, attribute)

    def content(self, count: int) -> tuple[float, ...]:
        """So many numbers in the element's text."""
        return self._split(self.text, count, f"<{self.tag}>")

    def limit(self, text: str, key: str) -> float:
        """A limit of a joint, which may be infinite: what is beyond `UNLIMITED` is that."""
        value = self._float(text, key)
        return self._number(text, key) if math.isnan(value) else min(max(value, -UNLIMITED), UNLIMITED)

    def unit(self, values: Sequence[float], joint: str) -> np.ndarray:
        """The axis of a joint (3,) with length 1."""
        return unit(values) if norm(values) > 0 else self.refuse(f"joint {joint}: its axis is 0 0 0; give a direction")

    @property
    def place(self) -> str:
        """File and line."""
        return f"{self.where}, line {self.line}"

    def refuse(self, problem: str) -> NoReturn:
        """Raise ModelError with the element's place."""
        raise ModelError(placed(self.where, self.line, problem))

    def _split(self, text: str, count: int, key: str) -> tuple[float, ...]:
        parts = text.split()
        if len(parts) != count:
            self.refuse(f"{key}: {count} numbers are needed, {shown(text)} is given")
        return tuple(self._number(number, key) for number in parts)

    def _float(self, text: str, key: str) -> float:
        try:
            return float(text)
        except ValueError:
            self.refuse(f"{key}: {shown(text)} is no number")

    def _number(self, text: str, key: str) -> float:
        value = self._float(text, key)
        if not math.isfinite(value):
            self.refuse(f"{key}: {shown(text)} is not finite; give a number")
        if abs(value) > MAX_NUMBER:
            self.refuse(f"{key}: {shown(text)} is too large; the largest number is {MAX_NUMBER:g}, check the unit")
        return value


def refusals(read: Callable[[Markup], object], elements: Iterable[Markup]) -> list[str]:
    """What a reader says against elements, one after the other."""
    refused = []
    for each in elements:
        try:
            read(each)
        except ModelError as error:
            refused.append(str(error))
    return refused


def read_markup(path: Path) -> Markup:
    """The root element of a file. Raises ModelError with the line of what is no XML, or what this reader does not take."""
    parser = expat.ParserCreate()
    reader = _Reader(path.name, parser)
    try:
        parser.Parse(text_of(path), True)
    except expat.ExpatError as error:
        raise ModelError(placed(path.name, error.lineno, f"no XML: {expat.ErrorString(error.code)}; correct it there or before")) from None
    return reader.root.children[0]


class _Reader:
    """What the parser calls."""

    def __init__(self, where: str, parser: expat.XMLParserType) -> None:
        self.where, self.parser = where, parser
        self.root = Markup(tag="", attributes=Attributes({}), line=1, where=where)
        self.open = [self.root]
        parser.StartElementHandler, parser.EndElementHandler = self._start, self._end
        parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = self._text, self._document_type
        parser.buffer_text = True

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        element = Markup(tag=tag, attributes=Attributes(attributes), line=self.parser.CurrentLineNumber, where=self.where)
        if tag.startswith("xacro:") and not any(each.tag in PICTURES for each in self.open):
            name = self.where.removesuffix(XACRO)
            name = f"expanded-{name}" if name == self.where else name  # or the shell empties the file before xacro reads it
            element.refuse(f"<{tag}> is a macro of xacro; expand it first: xacro {shown(self.where)} > {shown(name)}")
        if len(self.open) > MAX_DEPTH:
            element.refuse(f"elements are more than {MAX_DEPTH} deep in each other; a robot needs no such depth")
        self.open[-1].children.append(element)
        self.open.append(element)

    def _end(self, tag: str) -> None:
        self.open.pop()

    def _text(self, text: str) -> None:
        self.open[-1].raw += text

    def _document_type(self, *declared: object) -> None:
        problem = "document types and entities are not read; remove <!DOCTYPE …> and write out what it stands for"
        raise ModelError(placed(self.where, self.parser.CurrentLineNumber, problem))
