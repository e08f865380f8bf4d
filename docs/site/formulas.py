"""Formulas as MathML, which browsers draw by themselves: no script and no font has to be fetched."""

from __future__ import annotations

import re
from html import unescape

from latex2mathml.converter import convert

FORMULA = re.compile(r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<tex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL)


def on_page_content(html: str, **kwargs: object) -> str:
    """mkdocs calls this with every page."""
    return FORMULA.sub(_drawn, html)


def _drawn(found: re.Match[str]) -> str:
    return convert(unescape(found["tex"]), display="block" if found["tag"] == "div" else "inline")
