"""Pages use the terms of the field, so that a reader can search for them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from terms import misused

ROOT = Path(__file__).resolve().parents[2]

PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]


def prose(text: str) -> str:
    """A page without its code."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```$|^    .*?$", "", text, flags=re.DOTALL | re.MULTILINE))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_has_the_terms_of_the_field(page):
    assert misused(prose(page.read_text(encoding="utf-8"))) == []


def test_the_check_sees_old_words_in_prose_only():
    assert misused(prose("Two freedoms\nare told.\n\n```python\nbeside = 1\n```\n`beside`")) == [
        "freedoms: write degrees of freedom",
        "are told: write is reported",
    ]
