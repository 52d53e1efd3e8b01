"""Features that follow from an observation: the tracker's own slot and the way to it.

They contain nothing that the observation lacks; a network could learn them, but would first have to
learn the geometry: ranges times directions, the slots from the formation and ψ, and the matching of
slots to trackers.

All vectors are relative to the tracker: x ahead, y to the left. A length d is scaled to
d / (d + scale), which resolves both centimetres near the slot and tens of metres far from it.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from posse import ObservationLayout
from posse.numeric import FloatArray, Records, compiled
from posse_baselines.laws.offsets import offsets_of
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

_NEEDED: Final = (
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


def feature_tables(layout: ObservationLayout) -> tuple[Records, FloatArray]:
    """Return the offsets of a layout's fields, an array of one record, and the slots (N, 2).

    Raises:
        PolicyError: The layout lacks a field that features are computed from.
    """
    missing = [name for name in _NEEDED if name not in layout.offsets]
    if missing:
        raise PolicyError(
            f"the observations of scenario {layout.scenario.name!r} lack {missing[0]!r}, which the policy needs"
        )
    return offsets_of(layout), np.array(layout.scenario.slot_offsets, np.float32)


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
def write_features(row: FloatArray, f: Any, slots: FloatArray, scratch: FloatArray, out: FloatArray) -> None:
    """Write the features of one observation (F,) to ``out`` (NUM_FEATURES,).

    The record ``f`` and ``slots`` come from :func:`feature_tables`; ``scratch`` is (SCRATCH,).
    """
    for k in range(NUM_FEATURES):
        out[k] = _ZERO
    xs, ys, numbers = scratch[:MOST], scratch[MOST : 2 * MOST], scratch[2 * MOST : 3 * MOST]
    chosen, ways = scratch[3 * MOST : 4 * MOST], scratch[4 * MOST :]
    count = gather_team(row, f, xs, ys, numbers)
    top, speed = row[f.max_speed], row[f.speed]
    out[0] = speed / top
    out[1] = row[f.turn_rate] / row[f.max_turn_rate]
    for m in range(min(count - 1, _MATES)):
        place = m * f.stride
        heading, mate_speed = f.neighbour_heading + place, row[f.neighbour_speed + place]
        _soft(xs[m + 1], ys[m + 1], _ONE, out[2 + 4 * m : 4 + 4 * m])
        out[4 + 4 * m] = mate_speed * row[heading] - speed
        out[5 + 4 * m] = mate_speed * row[heading + 1]
    if row[f.target_known] == _ZERO:
        return
    o = out[2 + 4 * _MATES :]
    vx, vy = row[f.target_velocity], row[f.target_velocity + 1]
    age = min(row[f.target_age], OLDEST)
    x = row[f.target_range] * row[f.target_bearing] + vx * age
    y = row[f.target_range] * row[f.target_bearing + 1] + vy * age
    c, n = row[f.target_frame], row[f.target_frame + 1]
    hx, hy = row[f.target_heading], row[f.target_heading + 1]
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
    o[7] = hx * c + hy * n  # its heading in the slot frame
    o[8] = hy * c - hx * n
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
    o[18] = max(-_ONE, min(_ONE, _TURN_GAIN * error / row[f.max_turn_rate]))
    held = 0
    for j in range(count):
        s = int(chosen[j])
        if s >= 0 and j != me:
            held += ways[j * num_slots + s] < _NEAR
    o[19] = np.float32(held) / np.float32(max(count - 1, 1))
    o[20] = row[f.target_seen]
    o[21] = row[f.target_age] / (row[f.target_age] + _ONE)
    o[22] = _ONE
