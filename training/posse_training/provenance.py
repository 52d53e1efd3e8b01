"""The commit of the sources, for figures and policies."""

from __future__ import annotations

import subprocess
from pathlib import Path


def commit() -> str | None:
    """Return the commit of the sources, with ``+`` if they have changes; ``None``: unknown."""
    here = Path(__file__).parent

    def git(*arguments: str) -> str:
        done = subprocess.run(["git", *arguments], cwd=here, capture_output=True, text=True, check=True, timeout=10)
        return done.stdout.strip()

    try:
        # Changes of pages and results do not count.
        sources = [f":/{root}" for root in ("envs", "baselines", "training")]
        changed = git("status", "--porcelain", "--", *sources, ":(exclude,top)**/shipped/*")
        return git("rev-parse", "--short=12", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return None
