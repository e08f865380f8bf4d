"""The terms of the field, for checks of pages, messages and docstrings."""

from __future__ import annotations

import re

TERMS = {
    r"freedoms(?! of)": "degrees of freedom",
    r"(?<!functional )mock-up units?": "FMU",
    r"numbers? that (?:is|are) none": "NaN",
    r"(?<!there )(?:is|are|was|were) none": "not allowed, not a …",
    r"(?:is|are) told": "is reported",
    r"(?:is|are|be|was) said": "is defined, is described",
    r"telling": "progress, messages",
    r"call backs?": "callback",
    r"the regular system": "KKT system",
    r"beside": "next to, compared with, about",
    r"goes? on": "continues",
    r"settled?": "projected, assembled",
    r"way back": "reverse sweep, projection",
    r"written out": "straight-line code",
}
"""{a word that the project used to have: what readers search for}, as whole words in any case."""


def misused(text: str) -> list[str]:
    """The old words in prose, each with what to write."""
    flat = " ".join(re.sub(r"`[^`\n]*`", "", text).split())
    return [f"{match[0]}: write {better}" for word, better in TERMS.items() for match in re.finditer(rf"\b(?:{word})\b", flat, re.I)]
