"""Users' modules: the examples of the manual, written to a folder and run there."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

from tests.support.process import python

DOCS = Path(__file__).parents[2] / "docs"


def examples(chapter: str) -> dict[str, str]:
    """Return the modules of a chapter of the manual by name."""
    text = (DOCS / chapter).read_text(encoding="utf-8")
    return dict(re.findall(r'```python title="(\w+)\.py"\n(.*?)```', text, re.DOTALL))


def run(folder: Path, code: str, **modules: str) -> subprocess.CompletedProcess[str]:
    """Run code with a user's modules in a new process."""
    for name, source in {**modules, "main": code}.items():
        (folder / f"{name}.py").write_text(source, encoding="utf-8")
    return python("main.py", cwd=folder)
