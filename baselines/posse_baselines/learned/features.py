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

from posse.numeric import ONE, ZERO, FloatArray, Record, compiled

_SMALL: Final = np.float32(1e-6)
_LARGE: Final = np.float32(1e9)
_NEAR: Final = np.float32(0.3)  # m, the default tolerance
_FAR: Final = np.float32(3.0)  # m
_GAIN: Final = np.float32(0.8)  # 1/s, of the slot law
_TURN_GAIN: Final = np.float32(3.0)  # 1/s
_OLDEST: Final = np.float32(2.0)  # s; a position is extrapolated for this long at most
_BIT: Final = np.uint64(1)

_MOST: Final = 16
"""Robots in a matching at most: the own one and the nearest ones that it knows of."""
_MATES: Final = 3
_OWN: Final = 2 + 4 * _MATES
"""Features before those of the target, which are zeros while it is unknown."""
NUM_FEATURES: Final = _OWN + 23


def scratch_for(num_slots: int) -> tuple[int, int]:
    """Return the shape of the array that :func:`write_features` works in."""
    return 4 + num_slots, _MOST


@compiled
def write_features(row: FloatArray, f: Record, slots: FloatArray, scratch: FloatArray, out: FloatArray) -> None:
    """Write the features of one observation (F,) to ``out`` (NUM_FEATURES,).

    ``f`` has the offsets of the observation's fields, ``slots`` (N, 2) are in the slot frame.
    """
    for k in range(NUM_FEATURES):
        out[k] = ZERO
    xs, ys, numbers, chosen, ways = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4:]
    count = _gather_team(row, f, xs, ys, numbers)
    top, speed = row[f.max_speed], row[f.speed]
    out[0] = speed / top
    out[1] = row[f.turn_rate] / row[f.max_turn_rate]
    for m in range(min(count - 1, _MATES)):  # each mate's position and velocity
        place = m * f.stride
        heading, mate_speed = f.neighbour_heading + place, row[f.neighbour_speed + place]
        _soft(xs[m + 1], ys[m + 1], ONE, out[2 + 4 * m : 4 + 4 * m])
        out[4 + 4 * m] = mate_speed * row[heading] - speed
        out[5 + 4 * m] = mate_speed * row[heading + 1]
    if row[f.target_known] == ZERO:
        return
    o = out[_OWN:]
    vx, vy = row[f.target_velocity], row[f.target_velocity + 1]
    age = min(row[f.target_age], _OLDEST)
    x = row[f.target_range] * row[f.target_bearing] + vx * age
    y = row[f.target_range] * row[f.target_bearing + 1] + vy * age
    c, n = row[f.target_frame], row[f.target_frame + 1]
    hx, hy = row[f.target_heading], row[f.target_heading + 1]
    me = _sort_by_number(count, xs, ys, numbers)
    for s in range(len(slots)):
        sx, sy = _slot(slots[s], x, y, c, n)
        for j in range(count):
            wx, wy = xs[j] - sx, ys[j] - sy
            ways[s, j] = np.float32(math.sqrt(wx * wx + wy * wy))
    match_slots(count, len(slots), ways, chosen)
    mine = max(int(chosen[me]), 0)
    dx, dy = _slot(slots[mine], x, y, c, n)
    d = np.float32(math.sqrt(dx * dx + dy * dy))
    _soft(dx, dy, _NEAR, o[0:2])  # the way to the own slot
    _soft(dx, dy, _FAR, o[2:4])
    o[4] = d / (d + ONE)
    _soft(x, y, ONE, o[5:7])  # the target
    o[7] = hx * c + hy * n  # its heading in the slot frame
    o[8] = hy * c - hx * n
    o[9], o[10] = vx, vy
    o[11], o[12] = c, n
    _soft(slots[mine, 0], slots[mine, 1], _FAR, o[13:15])
    # The slot law: the slot's velocity plus a velocity towards it, proportional to the distance.
    wx, wy = vx + _GAIN * dx, vy + _GAIN * dy
    wanted = np.float32(math.sqrt(wx * wx + wy * wy))
    error = np.float32(math.atan2(wy, wx))
    o[15] = min(wanted / top, ONE)
    o[16] = wx / (wanted + _SMALL)
    o[17] = wy / (wanted + _SMALL)
    o[18] = max(-ONE, min(ONE, _TURN_GAIN * error / row[f.max_turn_rate]))
    held = 0
    for j in range(count):
        s = int(chosen[j])
        if s >= 0 and j != me:
            held += ways[s, j] < _NEAR
    o[19] = np.float32(held) / np.float32(max(count - 1, 1))  # share of the mates in their slots
    o[20] = row[f.target_seen]
    o[21] = row[f.target_age] / (row[f.target_age] + ONE)
    o[22] = ONE


@compiled
def _soft(x: np.float32, y: np.float32, scale: np.float32, out: FloatArray) -> None:
    """Write (x, y) with its length d replaced by d / (d + scale)."""
    d = np.float32(math.sqrt(x * x + y * y))
    out[0] = x / (d + scale)
    out[1] = y / (d + scale)


@compiled
def _slot(
    slot: FloatArray, x: np.float32, y: np.float32, c: np.float32, n: np.float32
) -> tuple[np.float32, np.float32]:
    """Return where a slot of a target at (x, y) is; (c, n) is the direction of the slot frame."""
    return np.float32(x + slot[0] * c - slot[1] * n), np.float32(y + slot[0] * n + slot[1] * c)


@compiled
def _gather_team(row: FloatArray, f: Record, xs: FloatArray, ys: FloatArray, numbers: FloatArray) -> int:
    """Write the present positions of the known team, own robot first; return their number."""
    xs[0], ys[0], numbers[0] = ZERO, ZERO, row[f.number]
    count = 1
    for p in range(f.neighbours):
        place = p * f.stride
        number = row[f.neighbour_number + place]
        if number < ZERO or count >= _MOST:
            continue
        length, bearing = row[f.neighbour_range + place], f.neighbour_bearing + place
        heading = f.neighbour_heading + place
        reach = row[f.neighbour_speed + place] * min(row[f.neighbour_age + place], _OLDEST)
        xs[count] = length * row[bearing] + row[heading] * reach
        ys[count] = length * row[bearing + 1] + row[heading + 1] * reach
        numbers[count] = number
        count += 1
    return count


@compiled
def _sort_by_number(count: int, xs: FloatArray, ys: FloatArray, numbers: FloatArray) -> int:
    """Sort robots by number, so that all trackers match alike; return the own robot's index."""
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
def match_slots(count: int, num_slots: int, ways: FloatArray, chosen: FloatArray) -> None:
    """Match ``count`` robots to slots; write each robot's slot to ``chosen``, -1 for none left.

    Greedy by distance, then pairwise swaps while one shortens the total distance. Trackers that
    know of the same robots get the same result. ``ways[s, j]`` is the distance of robot j from slot s, m.
    """
    for j in range(count):
        chosen[j] = -ONE
    taken = np.uint64(0)
    for _ in range(min(count, num_slots)):
        best, robot, slot = _LARGE, -1, -1
        for j in range(count):
            if chosen[j] >= ZERO:
                continue
            for s in range(num_slots):
                if ways[s, j] < best and (taken >> np.uint64(s)) & _BIT == np.uint64(0):
                    best, robot, slot = ways[s, j], j, s
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
                now = ways[a, i] + ways[b, j]
                then = ways[b, i] + ways[a, j]
                if then < now - _SMALL * now:
                    chosen[i], chosen[j] = np.float32(b), np.float32(a)
                    swapped = True
        if not swapped:
            break
