"""The paper's section 4: ``posse reproduce``."""

from __future__ import annotations

from posse_training.reproduce.reproduce import MEMBERS, MODELS, Settings, main, reproduce

__all__ = ["MEMBERS", "MODELS", "Settings", "main", "reproduce"]
