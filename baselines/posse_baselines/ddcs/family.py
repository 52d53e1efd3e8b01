"""The members of the DDCS family: one program, different settings."""

from __future__ import annotations

from typing import Any, Final

from posse_baselines.ddcs import Settings
from posse_baselines.ddcs.settings import NO_EXCHANGE

_PURSUIT: Final[dict[str, Any]] = {"guidance": "pngl", "turn_share": 1.0}
_CENTRALIZED: Final[dict[str, Any]] = {"model": "centralized", "follower_frame": "slot-frame"}

FAMILY: Final[dict[str, Settings]] = {
    "pngl-l-phi": Settings(
        model="centralized", navigation_constant=1.1, deviation="occupant", follower_frame="slot-frame", **_PURSUIT
    ),
    "pngl": Settings(deviation="slot", spread=0.1, **_PURSUIT),
    "deviated-pursuit": Settings(deviation="slot", **_PURSUIT),
    "velocity-pursuit": Settings(deviation="none", **_PURSUIT),
    "ddcs-centralized-pursuit": Settings(deviation="none", **_CENTRALIZED, **_PURSUIT),
    "ddcs-distributed": Settings(),
    "ddcs-centralized": Settings(**_CENTRALIZED),
    "ddcs-centralized-l-l": Settings(follower_law="l-l", **_CENTRALIZED),
    "ddcs-centralized-no-exchange": Settings(forbidden=NO_EXCHANGE, **_CENTRALIZED),
    "ddcs-no-radio": Settings(radio=False),
}
"""The members of the DDCS family, the baseline first."""
