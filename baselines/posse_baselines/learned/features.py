"""What a tracker can work out from its observation: which slot is its own, and how to get there.

Nothing here that the observation does not hold. A network could learn it, at the price of learning
geometry first: ranges times directions, the slots from the formation and ψ, and who takes which.

All vectors are ego: x ahead, y to the left. A length d enters softly, as d / (d + scale), so that
centimetres near the slot and tens of metres far from it are both told apart.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout
from posse.numeric import FloatArray, compiled
from posse.scenarios.formation import slot_offsets
from posse_baselines.policy import PolicyError

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_LARGE: Final = np.float32(1e9)
_BIT: Final = np.uint64(1)
_SMALL: Final = np.float32(1e-6)
_NEAR: Final = np.float32(0.3)  # m, the default tolerance
_FAR: Final = np.float32(3.0)
_GAIN: Final = np.float32(0.8)  # 1/s, of the slot law
_TURN_GAIN: Final = np.float32(3.0)  # 1/s
_OLD: Final = np.float32(2.0)  # s, how far a fix is carried on

_MATES: Final = 3
NUM_FEATURES: Final = 25 + 4 * _MATES
MOST: Final = 16
"""Trackers that an assignment takes into account: this one and the nearest that it knows of."""
SCRATCH: Final = MOST * (4 + 64)
"""float32 numbers of working memory that :func:`write_features` takes."""

_NAMES: Final = (
    "speed", "turn_rate", "max_speed", "max_turn_rate", "target_known", "target_seen", "target_age",
    "target_range", "target_bearing", "target_heading", "target_frame", "target_velocity",
    "neighbour_number", "number",
)  # fmt: skip
(
    _SPEED, _TURN, _MAX_SPEED, _MAX_TURN, _KNOWN, _SEEN, _AGE, _RANGE, _BEARING, _HEADING, _FRAME,
    _VELOCITY, _MATE, _NUMBER, _STRIDE, _PLACES,
) = range(16)  # fmt: skip

Offsets = npt.NDArray[np.int64]


def feature_tables(layout: ObservationLayout) -> tuple[Offsets, FloatArray]:
    """Return what the features are worked out with: where the fields lie, and the slots (N, 2).

    Raises:
        PolicyError: The layout lacks a field that they are made from.
    """
    missing = [name for name in _NAMES if name not in layout.offsets]
    if missing:
        raise PolicyError(
            f"scenario {layout.scenario.name!r} has no {missing[0]!r} in its observations, which "
            "the policy needs"
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
def assign(count: int, num_slots: int, ways: FloatArray, chosen: FloatArray) -> None:
    """Give each of ``count`` robots a slot of its own, ``chosen`` (-1: none is left for it).

    The nearest pair first, then swaps as long as one shortens the sum of the ways: what every
    tracker that knows of the same robots comes to as well. ``ways[j * num_slots + s]`` is the
    distance of robot j from slot s, m.
    """
    for j in range(count):
        chosen[j] = -_ONE
    taken = np.uint64(0)
    for _ in range(min(count, num_slots)):
        best, robot, slot = _LARGE, -1, -1
        for j in range(count):
            if chosen[j] >= _ZERO:
                continue
            for s in range(num_slots):
                way = ways[j * num_slots + s]
                if way < best and (taken >> np.uint64(s)) & _BIT == np.uint64(0):
                    best, robot, slot = way, j, s
        if robot < 0:
            break
        chosen[robot] = np.float32(slot)
        taken |= _BIT << np.uint64(slot)
    for _ in range(count):
        swapped = False
        for i in range(1, count):
            for j in range(i):
                a, b = int(chosen[i]), int(chosen[j])
                if a < 0 or b < 0:
                    continue
                now = ways[i * num_slots + a] + ways[j * num_slots + b]
                then = ways[i * num_slots + b] + ways[j * num_slots + a]
                if then < now - _SMALL * now:
                    chosen[i], chosen[j] = np.float32(b), np.float32(a)
                    swapped = True
        if not swapped:
            break


@compiled
def _gather_team(
    row: FloatArray, at: Offsets, xs: FloatArray, ys: FloatArray, numbers: FloatArray
) -> int:
    """Write where the team is by now, this robot first; return how many it knows of."""
    xs[0], ys[0], numbers[0] = _ZERO, _ZERO, row[at[_NUMBER]]
    count = 1
    for p in range(at[_PLACES]):
        k = at[_MATE] + p * at[_STRIDE]
        if row[k] < _ZERO or count >= MOST:
            continue
        reach = row[k + 7] * min(row[k + 1], _OLD)
        xs[count] = row[k + 2] * row[k + 3] + row[k + 5] * reach
        ys[count] = row[k + 2] * row[k + 4] + row[k + 6] * reach
        numbers[count] = row[k]
        count += 1
    return count


@compiled
def _sort_by_number(count: int, xs: FloatArray, ys: FloatArray, numbers: FloatArray) -> int:
    """Sort robots by number, so that all work out one assignment; return where the first went."""
    me = numbers[0]
    for i in range(1, count):
        x, y, number = xs[i], ys[i], numbers[i]
        j = i
        while j > 0 and numbers[j - 1] > number:
            xs[j], ys[j], numbers[j] = xs[j - 1], ys[j - 1], numbers[j - 1]
            j -= 1
        xs[j], ys[j], numbers[j] = x, y, number
    for i in range(count):
        if numbers[i] == me:
            return i
    return 0


@compiled
def write_features(
    row: FloatArray, at: Offsets, slots: FloatArray, scratch: FloatArray, out: FloatArray
) -> None:
    """Write the features of one observation (F,) to ``out`` (NUM_FEATURES,)."""
    for k in range(NUM_FEATURES):
        out[k] = _ZERO
    xs, ys, numbers = scratch[:MOST], scratch[MOST : 2 * MOST], scratch[2 * MOST : 3 * MOST]
    chosen, ways = scratch[3 * MOST : 4 * MOST], scratch[4 * MOST :]
    count = _gather_team(row, at, xs, ys, numbers)
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
    age = min(row[at[_AGE]], _OLD)
    k = at[_BEARING]
    x = row[at[_RANGE]] * row[k] + vx * age
    y = row[at[_RANGE]] * row[k + 1] + vy * age
    k = at[_FRAME]
    c, n = row[k], row[k + 1]
    k = at[_HEADING]
    me = _sort_by_number(count, xs, ys, numbers)
    num_slots = len(slots)
    for s in range(num_slots):
        sx, sy = _slot_x(slots, s, x, c, n), _slot_y(slots, s, y, c, n)
        for j in range(count):
            wx, wy = xs[j] - sx, ys[j] - sy
            ways[j * num_slots + s] = np.float32(math.sqrt(wx * wx + wy * wy))
    assign(count, num_slots, ways, chosen)
    mine = int(chosen[me])
    if mine < 0:
        mine = 0
    dx, dy = _slot_x(slots, mine, x, c, n), _slot_y(slots, mine, y, c, n)
    d = np.float32(math.sqrt(dx * dx + dy * dy))
    _soft(dx, dy, _NEAR, o[0:2])
    _soft(dx, dy, _FAR, o[2:4])
    o[4] = d / (d + _ONE)
    _soft(x, y, _ONE, o[5:7])
    o[7] = row[k] * c + row[k + 1] * n  # where it heads, in the slot frame
    o[8] = row[k + 1] * c - row[k] * n
    o[9], o[10] = vx, vy
    o[11], o[12] = c, n
    _soft(slots[mine, 0], slots[mine, 1], _FAR, o[13:15])
    # The slot law: the slot's velocity, and towards it in proportion to the distance.
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
