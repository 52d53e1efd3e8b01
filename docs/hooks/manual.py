"""What MkDocs calls while it builds the manual: parts of pages made from the code and from results.

A line ``{{ name arguments }}`` of a page is replaced by what the part of that name returns.
"""

import html
import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.pages import Page
from mkdocs.utils import get_relative_url

import declared_tables
import replays
import standings

ROOT: Final = Path(__file__).parents[2]


def bibtex() -> str:
    """Return how to cite posse, as the README has it."""
    return (ROOT / "README.md").read_text(encoding="utf-8").partition("## Cite\n")[2].strip()


def contributing() -> str:
    """Return CONTRIBUTING.md, whose links lead to pages here."""
    return (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").replace("](docs/", "](")


PARTS: Final[dict[str, Callable[..., str]]] = {
    "scenario": replays.scenario,
    "all_settings": declared_tables.all_settings,
    "observation": declared_tables.observation,
    "metrics": declared_tables.metrics,
    "reward_terms": declared_tables.reward_terms,
    "replay": replays.replay,
    "leaderboard": standings.leaderboard,
    "results": standings.results,
    "headroom": standings.headroom,
    "training_seeds": standings.training_seeds,
    "algorithms": standings.algorithms,
    "bibtex": bibtex,
    "contributing": contributing,
    "duel_script": standings.duel_script,
    "duel_leagues": standings.duel_leagues,
    "peers": standings.peers,
}
_CODE: Final = re.compile(r"<code>([^<\n]+)</code>")
_WORD: Final = re.compile(r"(?<!\S)\S{1,36}(?!\S)")
"""What stays in one piece, if it is not wider than a phone."""
_CELL: Final = re.compile(r"<td>(.*?)</td>", re.DOTALL)
_LONG: Final = 24
"""Letters from which a cell of a table keeps some width on a phone."""
_PART: Final = re.compile(r"^\{\{ (\w+)(.*?) \}\}$", re.MULTILINE)


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Fill in the parts of a page; ``site:`` in them is the way to the manual's root."""
    root = get_relative_url(".", page.url).rstrip("/") + "/"
    return _PART.sub(lambda found: _made(found).replace("site:", root), markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Typeset the equations of a page, keep names in one piece, and mark long cells of tables."""
    return typeset(_CELL.sub(_marked, _CODE.sub(_in_pieces, html)))


def _in_pieces(found: re.Match[str]) -> str:
    if len(found[1]) <= 36:
        return f'<code class="name">{found[1]}</code>'
    return "<code>" + _WORD.sub(r'<span class="name">\g<0></span>', found[1]) + "</code>"


def _marked(found: re.Match[str]) -> str:
    return f'<td class="long">{found[1]}</td>' if len(re.sub("<.*?>", "", found[1])) >= _LONG else found[0]


def on_post_build(config: MkDocsConfig, **_: Any) -> None:
    """Write the replays that pages show."""
    replays.write_replays(Path(config.site_dir))


def _made(found: re.Match[str]) -> str:
    name, arguments = found[1], shlex.split(found[2])
    if name not in PARTS:
        raise PluginError(f"unknown part {name!r} of a page; parts are: {', '.join(PARTS)}")
    return PARTS[name](*arguments)


_FUNCTION: Final = re.compile(r"(\\(?:sin|cos))(?![a-z(])")
_MARKED: Final = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</(?:span|div)>', re.DOTALL)


def typeset(page: str) -> str:
    """Replace the equations that pymdownx.arithmatex has marked by MathML, which needs neither scripts nor fonts."""
    return _MARKED.sub(_mathml, page)


def _mathml(marked: re.Match[str]) -> str:
    display = marked[1] == "div"
    tex = html.unescape(marked[2]).strip()
    spaced = _FUNCTION.sub(r"\1\\,", tex)  # the converter sets cos x as cosx
    mathml = convert(spaced, display="block" if display else "inline")
    # The source stays readable for whoever copies it, and for screen readers.
    mathml = mathml.replace("<math ", f'<math alttext="{html.escape(tex, quote=True)}" ', 1)
    return f'<div class="equation">{mathml}</div>' if display else mathml
