"""The built-in fields of what a robot observes of each team-mate, in order.

Where the radio is perfect they tell of the team-mate now, else of what was heard of it last. To add
a field, declare it here, or in a module of your own (:mod:`posse.signals.observation.fields`).
"""

from __future__ import annotations

from posse.numeric import Lanes, Record
from posse.rules.discs import within_one
from posse.scenarios import Scenario
from posse.signals.observation.fields import SLACK, field
from posse.signals.observation.views import Mate, View, ego

Pair = tuple[Lanes, Lanes]


def _turn(s: Scenario) -> float:
    return max(s.tracker_turn_rates) * SLACK


@field("1", -1, lambda s: s.num_trackers - 1, unknown=-1)
def neighbour_number(c: Record, v: View, m: Mate) -> Lanes:
    """Its number."""
    return m.number


@field("s", -1, lambda s: s.forget_after * SLACK, unknown=-1)
def neighbour_age(c: Record, v: View, m: Mate) -> Lanes:
    """Age of what was heard."""
    return m.age


@field("m", -1, lambda s: s.range_bound * SLACK, unknown=-1)
def neighbour_range(c: Record, v: View, m: Mate) -> Lanes:
    """Distance from here to where it was."""
    return m.distance


@field("1", -1, 1, unknown=0, size=2)
def neighbour_bearing(c: Record, v: View, m: Mate) -> Pair:
    """Direction of where it was, ego."""
    return within_one(m.ahead), within_one(m.left)


@field("1", -1, 1, unknown=0, size=2)
def neighbour_heading(c: Record, v: View, m: Mate) -> Pair:
    """Its heading, ego."""
    ahead, left = ego(v, m.heading_cos, m.heading_sin)
    return within_one(ahead), within_one(left)


@field("m/s", 0, lambda s: max(s.tracker_speeds) * SLACK, unknown=0)
def neighbour_speed(c: Record, v: View, m: Mate) -> Lanes:
    """Its speed."""
    return m.speed


@field("rad/s", lambda s: -_turn(s), _turn, unknown=0)
def neighbour_turn_rate(c: Record, v: View, m: Mate) -> Lanes:
    """Its turn rate."""
    return m.turn_rate
