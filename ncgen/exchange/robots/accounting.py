"""What a robot's file says, and what became of it: every element and attribute is modelled, only looks, is left out or is refused.

A format has a table of its vocabulary, `vocabulary/FORMAT.txt`, one line a word. At its end a reader asks `account` which words nobody has
read.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ncgen.exchange.robots.markup import Markup
from ncgen.files import contents

MEANINGS = ("modelled", "looks", "no effect", "left out", "refused")
"""What becomes of a word that is not at its default: a reader reads it; it is only seen, or names something, or says how a file is to be
handled, and is passed over; it is listed, and does not change the motion; it is listed, and would change it; the file is refused."""

WITHOUT_EFFECT = frozenset(
    {
        "transmissions", "settings of ros2_control", "calibrations", "effort limits", "sensors", "projectors", "lights", "batteries",
        "audio", "settings of physics engines", "roads", "magnetic fields", "atmospheres", "coordinates on the earth",
        "settings for collision detection", "settings for inertias of meshes", "axes of joints that have none",
        "screws and gears of joints that are none", "joints of models that rest", "meshes that are not there", "shapes of other kinds",
    }
)  # fmt: skip
"""What is listed and does not change the motion."""

NOT_MODELLED = "not modelled"
"""What ends the count in the warning of `warn_of`: a program that shows the list itself finds the warning by it."""


@dataclass(frozen=True, kw_only=True)
class Word:
    """A word of a format: an element, or an attribute of one.

    path: tags from an anchor on, as `link/inertial/mass` or `link@name`; an anchor is a path without `/`
    versions: of the format that have it; defaults: texts that say what is so without it
    words: for what is left out, the reason for a refusal, or for a modelled word where nobody reads it
    anchor: where the vocabulary of the element's inside stands, itself if empty
    """

    path: str
    versions: str
    defaults: tuple[str, ...]
    meaning: str
    words: str = ""
    anchor: str = ""

    def is_default(self, text: str) -> bool:
        """Whether a text says what is so without it."""
        return any(_plain(text) == _plain(default) for default in self.defaults)


@dataclass(frozen=True)
class Finding:
    """Something in a file that a model does not have. words: for people; meaning: "no effect" or "left out"."""

    words: str
    meaning: str


def _plain(text: str) -> tuple[float | str, ...]:
    """A text with numbers and truth values in one spelling."""
    return tuple(_value(word) for word in text.split())


def _value(word: str) -> float | str:
    if word.lower() in ("true", "false"):
        return float(word.lower() == "true")
    try:
        return float(word)
    except ValueError:
        return word


@cache
def vocabulary(name: str) -> dict[str, Word]:
    """{path: word} of a format. A line is `path | versions | defaults, "or" between | meaning | words`; `path = anchor` continues there."""
    lines = contents(Path(__file__).parent / "vocabulary" / f"{name}.txt", 1_000_000).decode().splitlines()
    words = (_word(line) for line in lines if line.strip() and not line.startswith("#"))
    return {word.path: word for word in words}


def _word(line: str) -> Word:
    entry, versions, default, meaning, words = (cell.strip() for cell in line.split("|"))
    path, _, anchor = (cell.strip() for cell in entry.partition("="))
    return Word(
        path=path,
        versions=versions,
        defaults=tuple(each.strip() for each in default.split(" or ")) if default else (),
        meaning=meaning,
        words=words,
        anchor=anchor,
    )


def account(root: Markup, words: dict[str, Word], anchor: str) -> list[Finding]:
    """What a file says and a model does not have, after a reader is done. Raises ModelError with file and line for what is refused.

    words: the format's vocabulary; anchor: the path of what stands in `root`
    """
    findings: list[Finding] = []
    _account(root, words, anchor, findings)
    return findings


def _account(root: Markup, words: dict[str, Word], anchor: str, findings: list[Finding]) -> None:
    read = root.attributes.read
    for name, text in dict.items(root.attributes):
        word = words.get(f"{anchor}@{name}")
        if word is None:
            if not name.startswith("xmlns"):
                findings.append(Finding(f"the attribute {name} of <{root.tag}>, which is none of the format's", "left out"))
        elif not (word.meaning == "modelled" and name in read) and not word.is_default(text):
            findings += _judged(root, word, f"the attribute {name} of <{root.tag}>")
    for child in root.children:
        word = words.get(f"{anchor}/{child.tag}")
        if word is None:
            findings.append(Finding(f"<{child.tag}> in <{root.tag}>, which is none of the format's elements", "left out"))
            continue
        text = child.raw.strip()
        if word.meaning == "modelled":
            if text and not child.is_read and not word.is_default(text):
                findings += _judged(child, word, f"<{child.tag}> in <{root.tag}>")
            _account(child, words, word.anchor or word.path, findings)
        elif child.children or not text or not word.is_default(text):
            findings += _judged(child, word, f"<{child.tag}> in <{root.tag}>")


def _judged(element: Markup, word: Word, label: str) -> list[Finding]:
    """What becomes of a word that is not at its default, and if it is modelled has not been read."""
    match word.meaning:
        case "refused":
            element.refuse(word.words)
        case "modelled":
            return [Finding(word.words or f"{label} that nothing reads", "left out")]
        case "looks":
            return []
        case meaning:
            return [Finding(word.words or label, meaning)]


def counted(findings: Iterable[Finding | str]) -> tuple[str, ...]:
    """What was found, in words with how often."""
    counts = Counter(each if isinstance(each, str) else each.words for each in findings)
    return tuple(f"{words} ({count})" for words, count in counts.items())


def changes_motion(sentence: str) -> bool:
    """Whether what `counted` says, without it, is a reason for another motion."""
    return parted(sentence)[0].partition(",")[0] not in WITHOUT_EFFECT


def parted(sentence: str) -> tuple[str, int]:
    """What was found and how often, of what `counted` says."""
    words, _, count = sentence.rpartition(" (")
    return words, int(count.rstrip(")"))


def warn_of(left_out: Iterable[str], file: str, stacklevel: int) -> None:
    """Warn once of what a file says, a model does not have, and would change its motion.

    left_out: of the model; stacklevel: of `warnings.warn` where this is called
    """
    acting = [parted(sentence) for sentence in left_out if changes_motion(sentence)]
    count = sum(number for _, number in acting)
    if count:
        nouns = "thing that changes the motion is" if count == 1 else "things that change the motion are"
        warnings.warn(
            f"{file}: {count} {nouns} {NOT_MODELLED}, {acting[0][0]} first; model.left_out and `ncgen inspect` list all",
            stacklevel=stacklevel + 1,
        )
