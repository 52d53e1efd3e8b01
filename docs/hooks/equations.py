"""Equations: TeX in a page becomes MathML when the manual is built.

Browsers typeset MathML themselves: a page needs neither scripts nor fonts for it.
"""

from __future__ import annotations

import html
import re
from typing import Final

from latex2mathml.converter import convert

_FUNCTION: Final = re.compile(r"(\\(?:sin|cos))(?![a-z(])")
_MARKED: Final = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</(?:span|div)>', re.DOTALL)


def typeset(page: str) -> str:
    """Replace the equations that pymdownx.arithmatex has marked in a page by MathML."""
    return _MARKED.sub(_mathml, page)


def _mathml(marked: re.Match[str]) -> str:
    display = marked[1] == "div"
    tex = html.unescape(marked[2]).strip()
    spaced = _FUNCTION.sub(r"\1\\,", tex)  # the converter sets cos x as cosx
    mathml = convert(spaced, display="block" if display else "inline")
    # The source stays readable for whoever copies it, and for screen readers.
    mathml = mathml.replace("<math ", f'<math alttext="{html.escape(tex, quote=True)}" ', 1)
    return f'<div class="equation">{mathml}</div>' if display else mathml
