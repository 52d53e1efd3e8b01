"""The smart motion: evasion with full knowledge of the state.

The target escapes through the widest gap until the team keeps station or a tracker comes too near.
Then it darts: it takes the turn that disrupts the formation most, and holds it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import Record, Records, compiled
from posse.rules.state import NEVER
from posse.rules.targets.declaring import Memory, target_motion
from posse.rules.targets.smart_plans import DART_TURN, plan_dart, plan_escape

SMART_REPLAN: Final = 5
"""Control steps between decisions."""
PATIENCE: Final = np.float32(3.0)
"""Time of station keeping by the whole team that triggers a dart, s."""

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_TWO: Final = np.float32(2.0)
_NO_BITS: Final = np.uint64(0)
_SLACK: Final = 1.001  # bounds are true for numbers rounded to float32, too
_STATION_MARGIN: Final = np.float32(1.0)  # m; beyond the outermost slot, counts as near
_STATION_SPEED: Final = np.float32(0.9)  # relative speed, as a share of V - v_t, that counts
_DANGER: Final = np.float32(0.6)  # times formation_distance; a nearer tracker triggers a dart
_ALARM: Final = np.float32(1e3)

_PRESSED: Final = Memory(
    "pressed",
    "s",
    lambda s: -float(DART_TURN) / s.target_turn_rate * _SLACK,
    float(PATIENCE),
    "of a smart target: time that the team has kept station; < 0: dart",
)


@target_motion("smart", memory=(_PRESSED,), mirrored=False)
def smart(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Escapes through the widest gap, and darts when the team keeps station (paper, section 2)."""
    if w.step % SMART_REPLAN == 0:
        evade(c, w, trackers, obstacles, s)


@compiled
def evade(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Set the goal heading until the next decision."""
    past = np.float32(SMART_REPLAN) * c.dt
    if w.touching != _NO_BITS:
        # Blocked by contact: leave in a free direction.
        w.pressed = _ZERO
        plan_escape(c, w, trackers, obstacles, s)
        return
    if w.pressed < _ZERO:
        w.pressed = min(_ZERO, w.pressed + past)
        return
    pressure = team_pressure(c, w, trackers)
    w.pressed = max(_ZERO, w.pressed + pressure * past)
    if w.pressed >= PATIENCE:
        w.pressed = -DART_TURN / c.target_turn_rate
        plan_dart(c, w, trackers, obstacles)
    else:
        plan_escape(c, w, trackers, obstacles, s)


@compiled
def team_pressure(c: Record, w: Record, trackers: Records) -> np.float32:
    """Return the commitment of the team: -1, no tracker keeps station, to 1, all do.

    A tracker keeps station if it is about as near as a slot and moves as the target does. A tracker
    much nearer than any slot triggers a dart at once.
    """
    near = c.slots_reach + _STATION_MARGIN
    danger = max(_DANGER * c.formation_distance, c.radius + c.radius)
    vx, vy = c.target_speed * w.heading_cos, c.target_speed * w.heading_sin
    committed = _ZERO
    for i in range(c.num_trackers):
        t = trackers[i]
        if t.broken_at != NEVER:
            continue
        slow = _STATION_SPEED * (t.max_speed - c.target_speed)
        dx, dy = t.x - w.x, t.y - w.y
        d2 = dx * dx + dy * dy
        if d2 < danger * danger:
            return _ALARM
        ux, uy = t.speed * t.heading_cos - vx, t.speed * t.heading_sin - vy
        if d2 < near * near and ux * ux + uy * uy < slow * slow:
            committed += _ONE
    return _TWO * committed / np.float32(max(w.working, 1)) - _ONE
