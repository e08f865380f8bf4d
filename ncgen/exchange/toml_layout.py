"""Where the tables and keys of a TOML text stand: what a parser of TOML does not tell.

The text has been parsed before, so this only needs to know where strings, lists and comments end.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field


@dataclass
class FileTable:
    """A table's word, the line of its header, and the lines of its keys, counted from 1."""

    word: str
    line: int
    keys: dict[str, int] = field(default_factory=dict)

    def line_of(self, key: str) -> int:
        """The line of a key; of the header where the table has no such key."""
        return self.keys.get(key, self.line)


_PART = r"""(?:[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')"""
_NAME = re.compile(rf"[ \t]*({_PART})([ \t]*\.[ \t]*({_PART}))?(?:[ \t]*\.[ \t]*{_PART})*[ \t]*")
_SKIPPED = re.compile(r"(?:[ \t\r\n]+|#[^\n]*)+")
_VALUE = re.compile(
    r'''"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?'{3,5}|"(?:[^"\\\n]|\\.)*"|'[^'\n]*'|[\[{]|[\]}]|\n|#[^\n]*|[^"'\[\]{}#\n]+''', re.S
)


def layout(text: str) -> list[FileTable]:
    """All tables of a TOML text in the order in which they stand; the first, without a word, is what stands above them."""
    tables = [FileTable("", 1)]
    latest: dict[str, FileTable] = {}
    current: FileTable | None = tables[0]  # None within a table of a table, whose keys belong to one key
    position, line, counted = 0, 1, 0
    while True:
        if skipped := _SKIPPED.match(text, position):
            position = skipped.end()
        if position >= len(text):
            return tables
        line, counted = line + text.count("\n", counted, position), position
        bracket = re.compile(r"\[{1,2}").match(text, position)
        name = _NAME.match(text, bracket.end() if bracket else position)
        if name is None:
            return tables
        word, inner = _plain(name[1]), name[3] and _plain(name[3])
        if bracket is None:
            if current is not None:
                current.keys.setdefault(word, line)
            position = _end_of_value(text, name.end() + 1)
            continue
        if inner is None or word not in latest:
            latest[word] = FileTable(word, line)
            tables.append(latest[word])
        if inner is not None:
            latest[word].keys.setdefault(inner, line)
        current = latest[word] if inner is None else None
        position = name.end() + len(bracket[0])


def _end_of_value(text: str, position: int) -> int:
    """Where the line ends on which a value ends."""
    depth = 0
    while piece := _VALUE.match(text, position):
        if piece[0] == "\n" and depth == 0:
            break
        depth += (piece[0] in "[{") - (piece[0] in "]}")
        position = piece.end()
    return position


def _plain(word: str) -> str:
    """A part of a key without its quotes."""
    return word[1:-1] if word[0] in "\"'" else word
