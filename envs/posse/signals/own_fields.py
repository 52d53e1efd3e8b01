"""The built-in observation fields, in order: the robot itself, its task, its target, each team-mate.

*Ego* means the robot's own frame, x ahead and y to the left; the *common frame* is a fixed frame
shared by the team. Directions are given as cosine and sine. Team-mates are described as they are
now if the radio is perfect, else as in the last message received. To add a field, declare it here,
or in a module of your own (:func:`posse.field`).
"""

import math

import numpy as np

from posse.declarations import field
from posse.numeric import ONE, TINY, ZERO, Lanes, Record, choose, compiled, eight, greater, lesser
from posse.scenarios import Scenario
from posse.scenarios.scenario import FORMATIONS, SLACK, UNLIMITED
from posse.signals.views import Mate, View, ego

Pair = tuple[Lanes, Lanes]


def _most_turn(s: Scenario) -> float:
    return max(*s.tracker_turn_rates, s.target_turn_rate) * SLACK


def _most_turn_of_mate(s: Scenario) -> float:
    return max(s.tracker_turn_rates) * SLACK


def _place(s: Scenario) -> float:
    return (s.position_bound + s.drift_bound) * SLACK


def _fast(s: Scenario) -> float:
    return max(s.tracker_speeds) * SLACK


def setting(name: str) -> None:
    """Declare a number of the scenario as a field of its name, with its unit and meaning; -1 for an unlimited one.

    The range holds the value, 0 and 1: wrappers of other libraries pad observations with 0 and 1.
    """
    declared = Scenario.settings()[name]

    def limited(c: Record) -> np.float32:
        return np.float32(c[name] if c[name] < UNLIMITED else -1.0)

    def low(s: Scenario) -> float:
        return -1.0 if math.isinf(getattr(s, name)) else 0.0

    def high(s: Scenario) -> float:
        value: float = getattr(s, name)
        return 1.0 if math.isinf(value) else max(1.0, value * SLACK)

    limited.__name__ = name
    limited.__doc__ = f"{declared.meaning[0].upper()}{declared.meaning[1:]}.".replace("inf:", "-1:")
    field(declared.unit, low, high)(limited)


@compiled
def within_one(value: Lanes) -> Lanes:
    """Return a cosine or sine, clipped to [-1, 1] against rounding."""
    return lesser(greater(value, -ONE), ONE)


# Own motion


@field("1", -1, 1, size=2)
def heading(c: Record, v: View) -> Pair:
    """Own heading in the common frame, cosine and sine."""
    return within_one(v.own.heading_cos), within_one(v.own.heading_sin)


@field("m", lambda s: -_place(s), _place, size=2)
def position(c: Record, v: View) -> Pair:
    """Own odometry in the common frame, x and y."""
    return v.own.x, v.own.y


@field("m/s", 0, _fast)
def speed(c: Record, v: View) -> Lanes:
    """Own speed."""
    return v.own.speed


@field("rad/s", lambda s: -_most_turn(s), _most_turn)
def turn_rate(c: Record, v: View) -> Lanes:
    """Own turn rate, positive to the left."""
    return v.own.turn_rate


@field("1", 0, 1)
def touching(c: Record, v: View) -> Lanes:
    """1 while it touches a robot, an obstacle or a wall."""
    return v.touching


@field("1", 0, 1)
def working(c: Record, v: View) -> Lanes:
    """0 once it is broken: its actions are ignored."""
    return v.working


# The task


@field("1", 0, 1, size=len(FORMATIONS))
def formation(c: Record) -> tuple[np.float32, np.float32, np.float32]:
    """Required formation, one-hot: wedge, ring, rows."""
    return np.float32(c.formation == 0), np.float32(c.formation == 1), np.float32(c.formation == 2)


@field("1", -1, lambda s: s.num_trackers - 1, unknown=-1)
def number(c: Record, v: View) -> Lanes:
    """Own number, 0 to N - 1."""
    return v.number


@field("1", 0, lambda s: s.num_trackers)
def team_size(c: Record) -> np.float32:
    """N, number of trackers in the team."""
    return np.float32(c.num_trackers)


for _name in ("formation_distance", "formation_spacing"):
    setting(_name)


@field("m/s", 0, _fast)
def max_speed(c: Record, v: View) -> Lanes:
    """Own greatest speed."""
    return v.own.max_speed


@field("rad/s", 0, _most_turn)
def max_turn_rate(c: Record, v: View) -> Lanes:
    """Own greatest turn rate."""
    return v.own.max_turn_rate


@field("s", 0, lambda s: max(1, max(s.tracker_speeds) / s.tracker_acceleration * SLACK))
def acceleration_time(c: Record, v: View) -> Lanes:
    """Time from rest to full speed; 0: no acceleration limit."""
    return choose(v.number < ZERO, ZERO, v.own.max_speed * c.per_acceleration)  # of a target agent: 0


@field("s", 0, lambda s: max(1, max(s.tracker_turn_rates) / s.tracker_turn_acceleration * SLACK))
def turn_acceleration_time(c: Record, v: View) -> Lanes:
    """Time from turn rate 0 to the greatest turn rate; 0: no acceleration limit."""
    return choose(v.number < ZERO, ZERO, v.own.max_turn_rate * c.per_turn_acceleration)


for _name in ("tolerance", "robot_radius", "control_step", "sensing_range", "sonar_range"):
    setting(_name)


@field("m", lambda s: 0 if s.walled else -1, lambda s: max(1, 2 * s.half_sides[0] * SLACK) if s.walled else 1)
def arena(c: Record) -> np.float32:
    """Side of the walled square, or width of the walled rectangle; -1: the open plane."""
    return np.float32(c.half_width + c.half_width if c.walled else -ONE)


@field("m", 0, lambda s: max(1, 2 * s.half_sides[1] * SLACK), when=lambda s: isinstance(s.arena, tuple))
def arena_height(c: Record) -> np.float32:
    """Height of the walled rectangle, along y."""
    return np.float32(c.half_height + c.half_height)


@field("s", 0, lambda s: s.duration * SLACK)
def time_left(c: Record, v: View) -> Lanes:
    """Time until the episode is truncated."""
    return greater(np.float32(c.horizon) - v.step, ZERO) * c.control_step  # a real robot may go on longer


# The target


@compiled
def _if_known(v: View, value: Lanes) -> Lanes:
    return choose(v.target_known, value, ZERO)


@compiled
def _direction(v: View, x: Lanes, y: Lanes) -> Pair:
    """Return a unit vector of the common frame in the ego frame; 0 if the target is unknown."""
    ahead, left = ego(v, x, y)
    return _if_known(v, within_one(ahead)), _if_known(v, within_one(left))


@field("1", 0, 1)
def target_known(c: Record, v: View) -> Lanes:
    """1 once it has a fix of the target, from its sensor or by radio."""
    return choose(v.target_known, ONE, ZERO)


@field("1", 0, 1)
def target_seen(c: Record, v: View) -> Lanes:
    """1 while its own sensor sees the target."""
    return v.target_seen


@field("s", -1, lambda s: s.duration * SLACK, unknown=-1)
def target_age(c: Record, v: View) -> Lanes:
    """Age of the fix described by the following fields."""
    return choose(v.target_known, (v.step - v.target_step) * c.control_step, -ONE)


def _farthest_mate(s: Scenario) -> float:
    return s.range_bound + 2 * math.sqrt(2) * s.drift_bound


def _farthest_fix(s: Scenario) -> float:
    measured = s.range_bound * (1 + 3 * s.range_noise + 3 * s.bearing_noise)
    # Under drift it may be another's fix, from where that tracker believed to be.
    return (measured + s.drifts * _farthest_mate(s)) * SLACK


@field("m", -1, _farthest_fix, unknown=-1)
def target_range(c: Record, v: View) -> Lanes:
    """Distance from the robot to the fix."""
    if c.fix_bearing:
        return eight(-ONE)
    return choose(v.target_known, v.target_distance, -ONE)


@field("1", -1, 1, unknown=0, size=2)
def target_bearing(c: Record, v: View) -> Pair:
    """Direction from the robot to the fix, ego."""
    per_metre = ONE / greater(v.target_distance, TINY)
    ahead, left = ego(v, v.target_dx * per_metre, v.target_dy * per_metre)
    ahead = choose(v.target_distance > ZERO, within_one(ahead), ONE)
    return _if_known(v, ahead), _if_known(v, within_one(left))


@field("1", -1, 1, unknown=0, size=2)
def target_heading(c: Record, v: View) -> Pair:
    """Heading of the target at the fix, ego."""
    return _direction(v, v.fix.cos, v.fix.sin)


@field("1", -1, 1, unknown=0, size=2)
def target_frame(c: Record, v: View) -> Pair:
    """Slot frame ψ at the fix, ego."""
    return _direction(v, v.fix.frame_cos, v.fix.frame_sin)


@field("m/s", lambda s: -_fast(s), _fast, unknown=0, size=2)
def target_velocity(c: Record, v: View) -> Pair:
    """Velocity of the target, estimated from successive fixes, ego."""
    ahead, left = ego(v, v.fix.vx, v.fix.vy)
    return _if_known(v, ahead), _if_known(v, left)


# Each team-mate


@field("1", -1, lambda s: s.num_trackers - 1, unknown=-1)
def neighbour_number(c: Record, v: View, m: Mate) -> Lanes:
    """The team-mate's number."""
    return m.number


@field("s", -1, lambda s: s.forget_after * SLACK, unknown=-1)
def neighbour_age(c: Record, v: View, m: Mate) -> Lanes:
    """Age of the last message received."""
    return m.age


@field("m", -1, lambda s: _farthest_mate(s) * SLACK, unknown=-1)
def neighbour_range(c: Record, v: View, m: Mate) -> Lanes:
    """Distance from the robot to the team-mate's position."""
    return m.distance


@field("1", -1, 1, unknown=0, size=2)
def neighbour_bearing(c: Record, v: View, m: Mate) -> Pair:
    """Direction from the robot to the team-mate's position, ego."""
    ahead, left = ego(v, m.dx, m.dy)
    apart, per_metre = m.distance > ZERO, ONE / greater(m.distance, TINY)
    return within_one(choose(apart, ahead * per_metre, ONE)), within_one(choose(apart, left * per_metre, ZERO))


@field("1", -1, 1, unknown=0, size=2)
def neighbour_heading(c: Record, v: View, m: Mate) -> Pair:
    """The team-mate's heading, ego."""
    ahead, left = ego(v, m.heading_cos, m.heading_sin)
    return within_one(ahead), within_one(left)


@field("m/s", 0, _fast, unknown=0)
def neighbour_speed(c: Record, v: View, m: Mate) -> Lanes:
    """The team-mate's speed."""
    return m.speed


@field("rad/s", lambda s: -_most_turn_of_mate(s), _most_turn_of_mate, unknown=0)
def neighbour_turn_rate(c: Record, v: View, m: Mate) -> Lanes:
    """The team-mate's turn rate."""
    return m.turn_rate
