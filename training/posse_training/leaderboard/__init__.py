"""Result files of the leaderboard: made by ``posse submit``, checked by ``posse verify``."""

from __future__ import annotations

from posse_training.leaderboard.result_file import ResultFile, read_result, write_result
from posse_training.leaderboard.submit import play_for_result
from posse_training.leaderboard.verify import Verdict, verify

__all__ = ["ResultFile", "Verdict", "play_for_result", "read_result", "verify", "write_result"]
