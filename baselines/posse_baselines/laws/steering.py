"""Slots: their motion, the law that takes up and holds one, who takes which; and pushes in the search.

A slot is an arm (m) from a leader or the target, in a frame that turns with it: the slot frame ψ, or the leader's own
heading. In a turning frame each slot moves on its own circle.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse.numeric import MOST_THREADS, Records, compiled
from posse_baselines.laws.geometry import angle_of, cross, dot, length, scaled, vector
from posse_baselines.laws.safeguard import DISC

WORK_ROWS: Final = 7
"""Rows of the work array of :func:`assign`."""

_SLOW: Final = 1e-2  # m/s; below it a slot's direction of motion is undefined
_MIN_DISTANCE: Final = 1e-3  # m; a shorter one counts as this one where it is divided by
_CLEARANCE: Final = 0.75  # m; that a path keeps from the target
_LEAST_TURN: Final = 0.6  # rad; least angle ahead on the circle for a tracker on or inside it
_CLOSE: Final = np.float32(0.5)  # m; a nearer team-mate pushes as one at this distance
_MOST_DISCS: Final = 32


class Work(NamedTuple):
    """Arrays that laws work in, one of each for a thread."""

    cost: npt.NDArray[np.float64]
    """(N, N) cost of each slot for each tracker, s."""
    assigning: npt.NDArray[np.float64]
    """(WORK_ROWS, N + 1) for :func:`assign`."""
    discs: Records
    """(32,) :data:`~posse_baselines.laws.safeguard.DISC`: what is near a robot."""


def work_for(num_trackers: int) -> Work:
    """Return the arrays of all threads of this machine, for one call of a kernel."""
    n, threads = num_trackers, MOST_THREADS
    cost, assigning = np.empty((threads, n, n)), np.empty((threads, WORK_ROWS, n + 1))
    return Work(cost, assigning, np.empty((threads, _MOST_DISCS), DISC))


@compiled
def work_of(works: Work, thread: int) -> Work:
    """Return the arrays of a thread."""
    return Work(works.cost[thread], works.assigning[thread], works.discs[thread])


@compiled
def slot_velocity(velocity: complex, frame_rate: float, arm: complex) -> complex:
    """Return the velocity (m/s) of a slot on an arm (m) that turns at ``frame_rate`` (rad/s)."""
    return complex(velocity.real - frame_rate * arm.imag, velocity.imag + frame_rate * arm.real)


@compiled
def slot_heading(velocity: complex, frame_rate: float, arm: complex, resting: float) -> float:
    """Return the heading (rad) of a robot in its slot: tangent to the slot's path.

    ``resting`` (rad) is the heading where the slot hardly moves.
    """
    v = slot_velocity(velocity, frame_rate, arm)
    return angle_of(v) if length(v) > _SLOW else resting


@compiled
def approach_velocity(way: complex, slot: complex, gain: float, max_speed: float) -> complex:
    """Return the wanted velocity (m/s) of a tracker whose slot lies ``way`` (m) off: the slot law.

    The slot's velocity (m/s) plus ``gain`` (1/s, below 1 / control step) times the way. Where that is more than
    ``max_speed``, the part along the way is shortened until it is not: the tracker moves at full speed on the straight
    intercept course of a slot of constant velocity. A slot faster than the tracker is followed in its own direction.
    """
    distance = length(way)
    approach = gain * distance
    unit = complex(way.real / max(distance, _MIN_DISTANCE), way.imag / max(distance, _MIN_DISTANCE))
    opening = dot(slot, unit)
    surplus = max_speed**2 - slot.real**2 - slot.imag**2
    if surplus >= 0.0:
        approach = min(approach, math.sqrt(surplus + opening**2) - opening)
    velocity = slot + scaled(unit, approach)
    speed = length(velocity)
    return velocity if speed <= max_speed else scaled(velocity, max_speed / speed)


@compiled
def way_round(start: complex, goal: complex) -> complex:
    """Return the next waypoint from one position to another around the origin (m).

    The goal itself if the straight path keeps a clearance of 0.75 m from the origin; else the tangent point
    on that circle, on the shorter side. A tracker on the circle heads for a point a little further
    along it, and comes no nearer than 0.82 of the clearance.
    """
    way = goal - start
    square, along, crossing = dot(way, way), -dot(start, way), cross(start, way)
    if along <= 0.0 or along >= square or crossing * crossing >= _CLEARANCE * _CLEARANCE * square:
        return goal
    scale = _CLEARANCE / max(length(start), 1e-6)
    angle = max(math.acos(min(1.0, scale)), _LEAST_TURN)
    return scaled(start * vector(1.0, -angle if crossing < 0.0 else angle), scale)


@compiled
def assign(cost: npt.NDArray[Any], work: npt.NDArray[Any]) -> None:
    """Assign every row to a column of its own so that the sum of the costs is least.

    The Hungarian method in the form of Jonker and Volgenant (1987): one row after the other is
    added along the cheapest augmenting path, O(n³).

    Args:
        cost: (rows, n), rows <= n, finite; left as it is. A row of zeros takes a column that is left over.
        work: (WORK_ROWS, n + 1); in the end ``work[0, i]`` is the column of row i.
    """
    rows, n = cost.shape
    # Rows and columns count from 1 here; 0 means none.
    answer, row_price, column_price, row_of = work[0], work[1], work[2], work[3]
    path, slack, done = work[4], work[5], work[6]
    work[1:5] = 0.0
    for i in range(1, rows + 1):
        row_of[0] = i
        j0 = 0
        for j in range(n + 1):
            slack[j] = 1e30
            done[j] = 0.0
        while True:
            done[j0] = 1.0
            i0 = int(row_of[j0])
            delta, j1 = 1e30, 0
            for j in range(1, n + 1):
                if done[j] == 0.0:
                    reduced = cost[i0 - 1, j - 1] - row_price[i0] - column_price[j]
                    if reduced < slack[j]:
                        slack[j] = reduced
                        path[j] = j0
                    if slack[j] < delta:
                        delta, j1 = slack[j], j
            for j in range(n + 1):
                if done[j] != 0.0:
                    row_price[int(row_of[j])] += delta
                    column_price[j] -= delta
                else:
                    slack[j] -= delta
            j0 = j1
            if row_of[j0] == 0.0:
                break
        while j0 != 0:
            j1 = int(path[j0])
            row_of[j0] = row_of[j1]
            j0 = j1
    for j in range(1, n + 1):
        if row_of[j] != 0.0:
            answer[int(row_of[j]) - 1] = j - 1


@compiled
def push_from(mate: complex, strength: float) -> complex:
    """Return the push from a team-mate (m, relative to the robot) at a distance d: ``strength`` (m²) / d²."""
    d: Any = max(length(mate), _CLOSE)
    return scaled(mate, -strength / (d * d * d))


@compiled
def push_inwards(place: complex, start: complex) -> complex:
    """Return the push to the middle along x and y at a place (m) from it, by their distances from the middle (m).

    It is 0 up to ``start``, then 0.5 more a metre, 1 at most.
    """
    x = min(max(0.5 * (abs(place.real) - start.real), 0.0), 1.0)
    y = min(max(0.5 * (abs(place.imag) - start.imag), 0.0), 1.0)
    return complex(-x if place.real > 0.0 else x, -y if place.imag > 0.0 else y)
