"""Pages use the terms of the field, so that a reader can search for them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

TERMS = {
    r"freedoms(?! of)": "degrees of freedom",
    r"(?<!functional )mock-up units?": "FMU",
    r"numbers? that (?:is|are) none": "NaN",
    r"(?:is|are|was|were) none": "not allowed, not a …",
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

PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]


def prose(text: str) -> str:
    """A page without its code."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```$|^    .*?$", "", text, flags=re.DOTALL | re.MULTILINE))


def misused(text: str) -> list[str]:
    """The old words in a page's prose, each with what to write."""
    flat = " ".join(prose(text).split())
    return [f"{match[0]}: write {better}" for word, better in TERMS.items() for match in re.finditer(rf"\b(?:{word})\b", flat, re.I)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_has_the_terms_of_the_field(page):
    assert misused(page.read_text(encoding="utf-8")) == []


def test_the_check_sees_old_words_in_prose_only():
    assert misused("Two freedoms\nare told.\n\n```python\nbeside = 1\n```\n`beside`") == [
        "freedoms: write degrees of freedom",
        "are told: write is reported",
    ]
