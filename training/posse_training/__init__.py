"""Training, evaluation and reports.

What is listed here is imported when it is asked for, so that the command line starts at once.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from posse_training.evaluation import Results, evaluate

__all__ = ["Results", "evaluate"]


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(importlib.import_module("posse_training.evaluation"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
