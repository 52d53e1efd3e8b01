"""Scripted teams with settings that a search found, by scenario (``posse tune``)."""

from __future__ import annotations

from posse_baselines.tuned.files import TunedFile, read_tuned, tuned_files
from posse_baselines.tuned.policy import TUNED, TunedDDCS, from_file

__all__ = ["TUNED", "TunedDDCS", "TunedFile", "from_file", "read_tuned", "tuned_files"]
