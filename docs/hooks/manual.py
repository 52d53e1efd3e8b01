"""What MkDocs calls while it builds the manual: parts of pages made from the code and from results.

A line ``{{ name arguments }}`` of a page is replaced by what the part of that name returns.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from typing import Any, Final

from mkdocs.exceptions import PluginError

import declared_tables
from equations import typeset

PARTS: Final[dict[str, Callable[..., str]]] = {
    "settings": declared_tables.settings,
    "all_settings": declared_tables.all_settings,
    "observation_fields": declared_tables.observation_fields,
    "metrics": declared_tables.metrics,
    "reward_terms": declared_tables.reward_terms,
}
_PART: Final = re.compile(r"^\{\{ (\w+)(.*?) \}\}$", re.MULTILINE)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Fill in the parts of a page."""
    return _PART.sub(_made, markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Typeset the equations of a page."""
    return typeset(html)


def _made(found: re.Match[str]) -> str:
    name, arguments = found[1], shlex.split(found[2])
    if name not in PARTS:
        raise PluginError(f"unknown part {name!r} of a page; parts are: {', '.join(PARTS)}")
    return PARTS[name](*arguments)
