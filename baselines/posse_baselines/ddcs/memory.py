"""Memory of the trackers, as structured arrays with leading axes (E, N)."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

_F, _I = np.float32, np.int32


def _record(*fields: tuple[str, type]) -> np.dtype[Any]:
    return np.dtype((np.record, np.dtype(list(fields), align=True)))


SEARCHING: Final = 0
CONVERGING: Final = 1
FLOCKING: Final = 2
EXCHANGING: Final = 3
TASKS: Final = ("searching", "converging", "flocking", "leader exchange")

MIND: Final = _record(
    ("step", _I),  # control steps since it began
    # the target, as it was at the newest fix; common frame
    ("fix_step", _I),  # own step of that fix; -1: none yet
    ("x", _F),
    ("y", _F),
    ("theta", _F),
    ("psi", _F),
    ("speed", _F),
    ("turn", _F),  # estimated speed, turn rate
    ("speed_known", _I),  # 1: the speed has been measured
    ("raw_x", _F),
    ("raw_y", _F),  # the fix itself, before it was blended
    ("mean_x", _F),
    ("mean_y", _F),  # mean velocity
    # the target, as it is taken to be now
    ("now_x", _F),
    ("now_y", _F),
    ("now_theta", _F),
    ("psi_rate", _F),
    ("speed_x", _F),
    ("speed_y", _F),  # its velocity, m/s
    ("frame_cos", _F),
    ("frame_sin", _F),  # of the slot frame's heading
    ("age", _F),  # of the fix, s
    ("known", _I),  # 1: there is an estimate that is not too old
    ("sees", _I),  # 1: its own sensor has the target
    ("horizon", _F),  # distance within which every team-mate that is heard is listed, m
    ("usual_gap", _F),  # about the longest silence of a team-mate lately, s
    ("usual_age", _F),  # about the usual age of the fix, s
    # tracking
    ("task", _I),
    ("slot", _I),  # -1: none
    ("taken", np.uint64),  # bit set of slots in which the sonar detected a robot not heard
    ("error", _F),  # distance from its place (PNGL: excess of the range), m; -1: it has none
    ("pursues", _I),  # 1: under PNGL
    ("closing", _I),  # 1: the law itself, not the safeguard, keeps the range to the target
    ("side", _I),
    ("side_step", _I),  # of the last detour: 1 left, -1 right; when
    # the tracking layer's result; float64, so that storing it changes no action
    ("wish_x", np.float64),
    ("wish_y", np.float64),  # wanted velocity, common frame, m/s
    ("wish_speed", np.float64),
    ("wish_omega", np.float64),  # its command: m/s, rad/s
    # leadership
    ("leader", _I),  # -1: none yet
    ("term", _I),  # how often the lead has passed, modulo 256; the higher claim wins
    ("pulse", _I),  # the leader counts its steps, modulo 256; team-mates pass the count on
    ("pulse_step", _I),  # own step at which the count last went up
    ("confirmed", _I),  # 0: the leader has not been heard of since it was appointed
    ("exchanges", _I),  # times that the lead passed to another, as far as this one knows
    # searching
    ("goal_x", _F),
    ("goal_y", _F),
    ("goal_step", _I),  # where to, chosen when; -1: nowhere
    ("lost_step", _I),  # when the target was lost; -1: never seen yet
    ("area_x", _F),
    ("area_y", _F),  # middle of the area that is searched
)
"""Memory of one tracker."""

MATE: Final = _record(
    ("step", _I),  # own step at which it sent what follows; -1: never heard
    ("x", _F),
    ("y", _F),
    ("speed_x", _F),
    ("speed_y", _F),
    ("heading_cos", _F),
    ("heading_sin", _F),
    ("turn", _F),  # turn rate, rad/s
    ("fresh", _I),  # 1: heard in this step
    ("task", _I),
    ("leader", _I),
    ("term", _I),
    ("pulse", _I),
    ("slot", _I),  # -1: not said
)
"""Knowledge of a tracker about a team-mate: (E, N, N), the second N by the mate's number."""

GRID: Final = 16
"""Cells of a tracker's map of covered areas, along each axis."""
