"""The notebook as a page of the manual: its texts, its code, and what the cells put out."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path
from typing import Any, Final

_COLOUR: Final = re.compile(r"\x1b\[[0-9;]*m")
FOLDER: Final = Path(__file__).parents[1] / "tutorials"


def notebook(name: str) -> str:
    """Return a notebook of docs/tutorials as Markdown."""
    content = json.loads((FOLDER / name).read_text(encoding="utf-8"))
    return "\n\n".join(part for cell in content["cells"] for part in _cell(cell)) + "\n"


def _cell(cell: dict[str, Any]) -> list[str]:
    source = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        return [source]
    text = _COLOUR.sub("", "".join(map(_text, cell["outputs"]))).rstrip()
    shown = f'<pre class="output">{html.escape(text)}</pre>'.replace("\n", "&#10;")
    return [f"```python\n{source}\n```", *([shown] if text else []), *map(_frame, cell["outputs"])]


def _frame(output: dict[str, Any]) -> str:
    """Return a replay in a frame, or nothing."""
    page = "".join(output.get("data", {}).get("text/html", ""))
    if not page.startswith("<iframe"):
        return ""
    return page.replace("<iframe", '<iframe class="replay" loading="lazy"', 1)


def _text(output: dict[str, Any]) -> str:
    if output["output_type"] == "stream":
        return "".join(output["text"])
    return "" if _frame(output) else "".join(output.get("data", {}).get("text/plain", ""))
