"""The team as one tracker knows it, and the slots that it matches to its members."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from posse.numeric import FloatArray, compiled

MOST: Final = 16
"""Robots in a matching at most: the own one and the nearest ones that it knows of."""
OLDEST: Final = np.float32(2.0)
"""A position is extrapolated for this long at most, s."""

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_LARGE: Final = np.float32(1e9)
_SMALL: Final = np.float32(1e-6)
_BIT: Final = np.uint64(1)


@compiled
def gather_team(row: FloatArray, f: Any, xs: FloatArray, ys: FloatArray, numbers: FloatArray) -> int:
    """Write the present positions of the known team, own robot first; return their number.

    ``f`` has the offsets of the fields of the observation ``row``. All positions are relative to
    the own robot: x ahead, y to the left, m.
    """
    xs[0], ys[0], numbers[0] = _ZERO, _ZERO, row[f.number]
    count = 1
    for p in range(f.neighbours):
        place = p * f.stride
        number = row[f.neighbour_number + place]
        if number < _ZERO or count >= MOST:
            continue
        length, bearing = row[f.neighbour_range + place], f.neighbour_bearing + place
        heading = f.neighbour_heading + place
        reach = row[f.neighbour_speed + place] * min(row[f.neighbour_age + place], OLDEST)
        xs[count] = length * row[bearing] + row[heading] * reach
        ys[count] = length * row[bearing + 1] + row[heading + 1] * reach
        numbers[count] = number
        count += 1
    return count


@compiled
def sort_by_number(count: int, xs: FloatArray, ys: FloatArray, numbers: FloatArray) -> int:
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
    know of the same robots get the same result. ``ways[j * num_slots + s]`` is the distance of
    robot j from slot s, m.
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
