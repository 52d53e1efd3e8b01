"""A small comparison with its report, for tests."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from posse_training.reports.comparing.compare import Settings, compare
from posse_training.reports.comparing.comparison import Comparison

HOSTILE: Final = "</script><script>window.ran++</script><img src onerror>'\"&lt;{{shell}}<!--$x$]]>"
"""A label that would run as code if a page treated it as markup."""


def compared(out: Path, label: str = HOSTILE, *, replays: int = 2) -> Comparison:
    """Compare three policies in three worlds, one of them under a label."""
    return compare(
        Settings(
            ("pursuit", f"{label}=ddcs-distributed", "idle"),
            ("constant",),
            episodes=3,
            out=out,
            planner_episodes=0,
            replays=replays,
        )
    )
