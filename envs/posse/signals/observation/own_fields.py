"""The built-in observation fields of the robot itself, its task and its target, in order.

*Ego* means the robot's own frame, x ahead and y to the left; the *common frame* is a fixed frame
shared by the team. Directions are given as cosine and sine. To add a field, declare it here, or in
a module of your own (:mod:`posse.signals.observation.fields`).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import Lanes, Record, choose, compiled, eight, greater
from posse.rules.discs import within_one
from posse.scenarios import Scenario
from posse.scenarios.formation import FORMATIONS
from posse.scenarios.limits import FAR
from posse.signals.observation.fields import SLACK, field, setting
from posse.signals.observation.views import View, ego

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_MINUS_ONE: Final = np.float32(-1.0)
_TINY: Final = np.float32(1e-9)

Pair = tuple[Lanes, Lanes]


def most_turn(s: Scenario) -> float:
    """Return an upper bound of every robot's turn rate, rad/s."""
    return max(*s.tracker_turn_rates, s.target_turn_rate) * SLACK


def _place(s: Scenario) -> float:
    return s.position_bound * SLACK


def _fast(s: Scenario) -> float:
    return max(s.tracker_speeds) * SLACK


# Own motion


@field("1", -1, 1, size=2)
def heading(c: Record, v: View) -> Pair:
    """Own heading in the common frame, cosine and sine."""
    return within_one(v.heading_cos), within_one(v.heading_sin)


@field("m", lambda s: -_place(s), _place, size=2)
def position(c: Record, v: View) -> Pair:
    """Own odometry in the common frame, x and y."""
    return v.x, v.y


@field("m/s", 0, _fast)
def speed(c: Record, v: View) -> Lanes:
    """Own speed."""
    return v.speed


@field("rad/s", lambda s: -most_turn(s), most_turn)
def turn_rate(c: Record, v: View) -> Lanes:
    """Own turn rate, positive to the left."""
    return v.turn_rate


@field("1", 0, 1)
def touching(c: Record, v: View) -> Lanes:
    """1 while it touches a robot, an obstacle or a wall."""
    return v.touching


@field("1", 0, 1)
def working(c: Record, v: View) -> Lanes:
    """0 once it is broken: its actions are ignored."""
    return v.working


# The task


@compiled
def _one_if(truth: bool) -> np.float32:
    return _ONE if truth else _ZERO


@field("1", 0, 1, size=len(FORMATIONS))
def formation(c: Record) -> tuple[np.float32, np.float32, np.float32]:
    """Required formation, one-hot: wedge, ring, rows."""
    return _one_if(c.formation == 0), _one_if(c.formation == 1), _one_if(c.formation == 2)


@field("1", -1, lambda s: s.num_trackers - 1, unknown=-1)
def number(c: Record, v: View) -> Lanes:
    """Own number, 0 to N - 1."""
    return v.number


@field("1", 0, lambda s: s.num_trackers)
def team_size(c: Record) -> np.float32:
    """N, number of trackers in the team."""
    return np.float32(c.num_trackers)


@setting("m", lambda s: s.formation_distance)
def formation_distance(c: Record) -> np.float32:
    """Required distance from the target to the nearest slot."""
    return np.float32(c.formation_distance)


@setting("m", lambda s: s.formation_spacing)
def formation_spacing(c: Record) -> np.float32:
    """Required distance between neighbouring slots."""
    return np.float32(c.formation_spacing)


@field("m/s", 0, _fast)
def max_speed(c: Record, v: View) -> Lanes:
    """Own greatest speed."""
    return v.max_speed


@field("rad/s", 0, most_turn)
def max_turn_rate(c: Record, v: View) -> Lanes:
    """Own greatest turn rate."""
    return v.max_turn_rate


@field("s", 0, lambda s: max(1, max(s.tracker_speeds) / s.tracker_acceleration * SLACK))
def acceleration_time(c: Record, v: View) -> Lanes:
    """Time from rest to full speed; 0: no acceleration limit."""
    return v.acceleration_time


@field("s", 0, lambda s: max(1, max(s.tracker_turn_rates) / s.tracker_turn_acceleration * SLACK))
def turn_acceleration_time(c: Record, v: View) -> Lanes:
    """Time from turn rate 0 to the greatest turn rate; 0: no acceleration limit."""
    return v.turn_acceleration_time


@setting("m", lambda s: s.tolerance)
def tolerance(c: Record) -> np.float32:
    """Greatest distance from a slot at which a robot occupies it."""
    return np.float32(c.tolerance)


@setting("m", lambda s: s.robot_radius)
def robot_radius(c: Record) -> np.float32:
    """Radius of every robot's disc."""
    return np.float32(c.robot_radius)


@setting("s", lambda s: s.control_step)
def control_step(c: Record) -> np.float32:
    """Time between two actions."""
    return np.float32(c.control_step)


@setting("m", lambda s: s.sensing_range)
def sensing_range(c: Record) -> np.float32:
    """Range of its target sensor; -1: unlimited."""
    return np.float32(c.sensing_range) if c.sensing_range < FAR else _MINUS_ONE


@setting("m", lambda s: s.sonar_range)
def sonar_range(c: Record) -> np.float32:
    """Range of its sonar."""
    return np.float32(c.sonar_range)


@setting("m", lambda s: s.arena)
def arena(c: Record) -> np.float32:
    """Side of the walled square around the origin; -1: no walls."""
    return np.float32(c.arena) if c.walled else _MINUS_ONE


@field("s", 0, lambda s: s.duration * SLACK)
def time_left(c: Record, v: View) -> Lanes:
    """Time until the episode is truncated."""
    return (np.float32(c.horizon) - v.step) * c.control_step


# The target


@compiled
def _if_known(v: View, value: Lanes) -> Lanes:
    return choose(v.target_known, value, _ZERO)


@compiled
def _direction(v: View, x: Lanes, y: Lanes) -> Pair:
    """Return a unit vector of the common frame in the ego frame; 0 if the target is unknown."""
    ahead, left = ego(v, x, y)
    return _if_known(v, within_one(ahead)), _if_known(v, within_one(left))


@field("1", 0, 1)
def target_known(c: Record, v: View) -> Lanes:
    """1 once it has a fix of the target, from its sensor or by radio."""
    return choose(v.target_known, _ONE, _ZERO)


@field("1", 0, 1)
def target_seen(c: Record, v: View) -> Lanes:
    """1 while its own sensor sees the target."""
    return v.target_seen


@field("s", -1, lambda s: s.duration * SLACK, unknown=-1)
def target_age(c: Record, v: View) -> Lanes:
    """Age of the fix described by the following fields."""
    return choose(v.target_known, (v.step - v.target_step) * c.control_step, _MINUS_ONE)


def _farthest_fix(s: Scenario) -> float:
    return s.range_bound * (1 + 3 * s.range_noise + 3 * s.bearing_noise) * SLACK


@field("m", -1, _farthest_fix, unknown=-1)
def target_range(c: Record, v: View) -> Lanes:
    """Distance from the robot to the fix."""
    if c.fix_bearing != 0:
        return eight(_MINUS_ONE)
    return choose(v.target_known, v.target_distance, _MINUS_ONE)


@field("1", -1, 1, unknown=0, size=2)
def target_bearing(c: Record, v: View) -> Pair:
    """Direction from the robot to the fix, ego."""
    per_metre = _ONE / greater(v.target_distance, _TINY)
    ahead, left = ego(v, v.target_dx * per_metre, v.target_dy * per_metre)
    ahead = choose(v.target_distance > _ZERO, within_one(ahead), _ONE)
    return _if_known(v, ahead), _if_known(v, within_one(left))


@field("1", -1, 1, unknown=0, size=2)
def target_heading(c: Record, v: View) -> Pair:
    """Heading of the target at the fix, ego."""
    return _direction(v, v.target_cos, v.target_sin)


@field("1", -1, 1, unknown=0, size=2)
def target_frame(c: Record, v: View) -> Pair:
    """Slot frame ψ at the fix, ego."""
    return _direction(v, v.target_frame_cos, v.target_frame_sin)


@field("m/s", lambda s: -_fast(s), _fast, unknown=0, size=2)
def target_velocity(c: Record, v: View) -> Pair:
    """Velocity of the target, estimated from successive fixes, ego."""
    ahead, left = ego(v, v.target_vx, v.target_vy)
    return _if_known(v, ahead), _if_known(v, left)
