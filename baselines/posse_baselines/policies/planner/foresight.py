"""Where slots will be, on the path that the target took when the team was played ahead."""

from __future__ import annotations

from typing import Final

from posse.numeric import FloatArray, Record, compiled
from posse_baselines.laws.geometry import length
from posse_baselines.laws.slots import rotate

_FARTHEST: Final = 20.0  # s; later meetings are as good as this one
_MET: Final = 0.02  # m
_LEAST_STEP: Final = 0.01  # s
_MOST_STEPS: Final = 40


@compiled
def foreseen(path: FloatArray, at: float, slot: Record) -> tuple[float, float]:
    """Return where a slot will be, m, ``at`` control steps along a path.

    The path (T, 4) is the target's x, y and the slot frame's cosine and sine at each step; beyond
    its end the target goes straight on.
    """
    k = min(int(at), path.shape[0] - 2)
    share = at - k
    turned = min(share, 1.0)
    c = path[k, 2] + turned * (path[k + 1, 2] - path[k, 2])
    s = path[k, 3] + turned * (path[k + 1, 3] - path[k, 3])
    arm_x, arm_y = rotate(slot.x, slot.y, c, s)
    x = path[k, 0] + share * (path[k + 1, 0] - path[k, 0])
    y = path[k, 1] + share * (path[k + 1, 1] - path[k, 1])
    return x + arm_x, y + arm_y


@compiled
def arrival_time(path: FloatArray, at: float, slot: Record, x: float, y: float, max_speed: float, dt: float) -> float:
    """Return when a tracker at (x, y) can be in a slot, straight on at full speed, s from now.

    A slot never closes in faster than about ``max_speed`` itself, so the gap that is left bounds
    the time that is left from below.
    """
    time = 0.0
    for _ in range(_MOST_STEPS):
        slot_x, slot_y = foreseen(path, at + time / dt, slot)
        gap = length(slot_x - x, slot_y - y) - max_speed * time
        if gap <= _MET or time > _FARTHEST:
            break
        time += max(0.5 * gap / max_speed, _LEAST_STEP)
    return time
