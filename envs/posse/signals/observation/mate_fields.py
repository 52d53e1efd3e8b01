"""The built-in observation fields of each team-mate, in order.

They describe the team-mate's current state if the radio is perfect, else its state in the last
message received. To add a field, declare it here, or in a module of your own
(:mod:`posse.signals.observation.fields`).
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
    """The team-mate's number."""
    return m.number


@field("s", -1, lambda s: s.forget_after * SLACK, unknown=-1)
def neighbour_age(c: Record, v: View, m: Mate) -> Lanes:
    """Age of the last message received."""
    return m.age


@field("m", -1, lambda s: s.range_bound * SLACK, unknown=-1)
def neighbour_range(c: Record, v: View, m: Mate) -> Lanes:
    """Distance from the robot to the team-mate's position."""
    return m.distance


@field("1", -1, 1, unknown=0, size=2)
def neighbour_bearing(c: Record, v: View, m: Mate) -> Pair:
    """Direction from the robot to the team-mate's position, ego."""
    return within_one(m.ahead), within_one(m.left)


@field("1", -1, 1, unknown=0, size=2)
def neighbour_heading(c: Record, v: View, m: Mate) -> Pair:
    """The team-mate's heading, ego."""
    ahead, left = ego(v, m.heading_cos, m.heading_sin)
    return within_one(ahead), within_one(left)


@field("m/s", 0, lambda s: max(s.tracker_speeds) * SLACK, unknown=0)
def neighbour_speed(c: Record, v: View, m: Mate) -> Lanes:
    """The team-mate's speed."""
    return m.speed


@field("rad/s", lambda s: -_turn(s), _turn, unknown=0)
def neighbour_turn_rate(c: Record, v: View, m: Mate) -> Lanes:
    """The team-mate's turn rate."""
    return m.turn_rate
