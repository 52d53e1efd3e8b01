"""Features that follow from an observation: the tracker's own slot and the way to it.

They contain nothing that the observation lacks; a network could learn them, but would first have to
learn the geometry: ranges times directions, the slots from the formation and ψ, and the matching of
slots to trackers.

All vectors are relative to the tracker: x ahead, y to the left. A length d is scaled to
d / (d + scale), which resolves both centimetres near the slot and tens of metres far from it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout
from posse.numeric import FloatArray, compiled
from posse.scenarios.formation import slot_offsets
from posse_baselines.learned.team import MOST, OLDEST, gather_team, match_slots, sort_by_number
from posse_baselines.policy import PolicyError

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_SMALL: Final = np.float32(1e-6)
_NEAR: Final = np.float32(0.3)  # m, the default tolerance
_FAR: Final = np.float32(3.0)  # m
_GAIN: Final = np.float32(0.8)  # 1/s, of the slot law
_TURN_GAIN: Final = np.float32(3.0)  # 1/s

_MATES: Final = 3
NUM_FEATURES: Final = 25 + 4 * _MATES
SCRATCH: Final = MOST * (4 + 64)
"""Scratch memory of :func:`write_features`, in float32 numbers."""

_NAMES: Final = (
    "speed",
    "turn_rate",
    "max_speed",
    "max_turn_rate",
    "target_known",
    "target_seen",
    "target_age",
    "target_range",
    "target_bearing",
    "target_heading",
    "target_frame",
    "target_velocity",
    "neighbour_number",
    "number",
)
(
    _SPEED,
    _TURN,
    _MAX_SPEED,
    _MAX_TURN,
    _KNOWN,
    _SEEN,
    _AGE,
    _RANGE,
    _BEARING,
    _HEADING,
    _FRAME,
    _VELOCITY,
    _MATE,
    _NUMBER,
    _STRIDE,
    _PLACES,
) = range(16)

Offsets = npt.NDArray[np.int64]


def feature_tables(layout: ObservationLayout) -> tuple[Offsets, FloatArray]:
    """Return the offsets of the fields that features are computed from, and the slots (N, 2).

    Raises:
        PolicyError: The layout lacks such a field.
    """
    missing = [name for name in _NAMES if name not in layout.offsets]
    if missing:
        raise PolicyError(
            f"the observations of scenario {layout.scenario.name!r} lack {missing[0]!r}, which the policy needs"
        )
    offsets = [layout.offsets[name] for name in _NAMES] + [layout.stride, layout.neighbours]
    slots = np.array(slot_offsets(layout.scenario), np.float32)
    return np.array(offsets, np.int64), slots


@compiled
def _soft(x: np.float32, y: np.float32, scale: np.float32, out: FloatArray) -> None:
    """Write (x, y) with its length d replaced by d / (d + scale)."""
    d = np.float32(math.sqrt(x * x + y * y))
    out[0] = x / (d + scale)
    out[1] = y / (d + scale)


@compiled
def _slot_x(slots: FloatArray, s: int, x: np.float32, c: np.float32, n: np.float32) -> np.float32:
    return np.float32(x + slots[s, 0] * c - slots[s, 1] * n)


@compiled
def _slot_y(slots: FloatArray, s: int, y: np.float32, c: np.float32, n: np.float32) -> np.float32:
    return np.float32(y + slots[s, 0] * n + slots[s, 1] * c)


@compiled
def write_features(row: FloatArray, at: Offsets, slots: FloatArray, scratch: FloatArray, out: FloatArray) -> None:
    """Write the features of one observation (F,) to ``out`` (NUM_FEATURES,).

    ``at`` and ``slots`` come from :func:`feature_tables`; ``scratch`` is (SCRATCH,).
    """
    for k in range(NUM_FEATURES):
        out[k] = _ZERO
    xs, ys, numbers = scratch[:MOST], scratch[MOST : 2 * MOST], scratch[2 * MOST : 3 * MOST]
    chosen, ways = scratch[3 * MOST : 4 * MOST], scratch[4 * MOST :]
    mates_at, stride, places = at[_MATE], at[_STRIDE], at[_PLACES]
    count = gather_team(row, row[at[_NUMBER]], mates_at, stride, places, xs, ys, numbers)
    top, speed = row[at[_MAX_SPEED]], row[at[_SPEED]]
    out[0] = speed / top
    out[1] = row[at[_TURN]] / row[at[_MAX_TURN]]
    for m in range(min(count - 1, _MATES)):
        k = at[_MATE] + m * at[_STRIDE]
        _soft(xs[m + 1], ys[m + 1], _ONE, out[2 + 4 * m : 4 + 4 * m])
        out[4 + 4 * m] = row[k + 7] * row[k + 5] - speed
        out[5 + 4 * m] = row[k + 7] * row[k + 6]
    if row[at[_KNOWN]] == _ZERO:
        return
    o = out[2 + 4 * _MATES :]
    k = at[_VELOCITY]
    vx, vy = row[k], row[k + 1]
    age = min(row[at[_AGE]], OLDEST)
    k = at[_BEARING]
    x = row[at[_RANGE]] * row[k] + vx * age
    y = row[at[_RANGE]] * row[k + 1] + vy * age
    k = at[_FRAME]
    c, n = row[k], row[k + 1]
    k = at[_HEADING]
    me = sort_by_number(count, xs, ys, numbers)
    num_slots = len(slots)
    for s in range(num_slots):
        sx, sy = _slot_x(slots, s, x, c, n), _slot_y(slots, s, y, c, n)
        for j in range(count):
            wx, wy = xs[j] - sx, ys[j] - sy
            ways[j * num_slots + s] = np.float32(math.sqrt(wx * wx + wy * wy))
    match_slots(count, num_slots, ways, chosen)
    mine = int(chosen[me])
    if mine < 0:
        mine = 0
    dx, dy = _slot_x(slots, mine, x, c, n), _slot_y(slots, mine, y, c, n)
    d = np.float32(math.sqrt(dx * dx + dy * dy))
    _soft(dx, dy, _NEAR, o[0:2])
    _soft(dx, dy, _FAR, o[2:4])
    o[4] = d / (d + _ONE)
    _soft(x, y, _ONE, o[5:7])
    o[7] = row[k] * c + row[k + 1] * n  # its heading in the slot frame
    o[8] = row[k + 1] * c - row[k] * n
    o[9], o[10] = vx, vy
    o[11], o[12] = c, n
    _soft(slots[mine, 0], slots[mine, 1], _FAR, o[13:15])
    # The slot law: the slot's velocity plus a velocity towards it, proportional to the distance.
    wx, wy = vx + _GAIN * dx, vy + _GAIN * dy
    wanted = np.float32(math.sqrt(wx * wx + wy * wy))
    error = np.float32(math.atan2(wy, wx))
    o[15] = min(wanted / top, _ONE)
    o[16] = wx / (wanted + _SMALL)
    o[17] = wy / (wanted + _SMALL)
    o[18] = max(-_ONE, min(_ONE, _TURN_GAIN * error / row[at[_MAX_TURN]]))
    held = 0
    for j in range(count):
        s = int(chosen[j])
        if s >= 0 and j != me:
            held += ways[j * num_slots + s] < _NEAR
    o[19] = np.float32(held) / np.float32(max(count - 1, 1))
    o[20] = row[at[_SEEN]]
    o[21] = row[at[_AGE]] / (row[at[_AGE]] + _ONE)
    o[22] = _ONE
