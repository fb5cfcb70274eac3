"""Formulas: the TeX of pages and docstrings as MathML, which needs no network."""

import re
from html import unescape

from latex2mathml.converter import (  # type: ignore
    convert,
)

ARITHMATEX = re.compile(
    r'<(span|div) class="arithmatex">\\[\[(](.*?)\\[\])]</\1>', re.DOTALL
)
"""What `pymdownx.arithmatex` leaves of `$inline$` and of `$$display$$`."""


def with_mathml(html: str) -> str:
    """Return a page in which every formula is MathML."""
    return ARITHMATEX.sub(_formula, html)


def _formula(found: re.Match[str]) -> str:
    display = "block" if found[1] == "div" else "inline"
    formula = convert(unescape(found[2]).strip(), display=display)
    return f'<{found[1]} class="formula">{formula}</{found[1]}>'
