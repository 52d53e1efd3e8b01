"""The motions that need no knowledge of the team: constant, accelerating, and the target moved by a policy."""

import math
from typing import Any, Final

import numpy as np

from posse.declarations import target_motion
from posse.numeric import ZERO, Record, compiled
from posse.rules.kinematics import arc
from posse.rules.randomness import TARGET, TWO_PI, between, uniform

_LEAST_RATE: Final = 0.2  # rad/s
_MOST_RATE: Final = 0.8
_LEAST: Final = 0.4  # least and greatest turn rate, as shares of the limit
_MOST: Final = 0.9

# How fast amplitude and rate walk: standard deviations after a second, as a share of the limit and in rad/s. A sine of
# constant amplitude and rate could be predicted for ever from a few fixes.
_AMPLITUDE_WALK: Final = 0.05
_RATE_WALK: Final = 0.03


@target_motion("constant")
def constant(c: Record, w: Record) -> None:
    """Straight ahead at the initial heading (paper, section 2)."""


def draw_weave(c: Record, w: Record) -> None:
    """Draw amplitude, rate and phase of the sine."""
    limit = c.target_turn_rate
    w.weave_amplitude = between(_LEAST, _MOST, w.key, 0, TARGET, 100) * limit
    w.weave_rate = between(_LEAST_RATE, _MOST_RATE, w.key, 0, TARGET, 101)
    w.weave_phase = TWO_PI * uniform(w.key, 0, TARGET, 102)


@compiled
def walked(value: Any, step: Any, low: Any, high: Any) -> np.float32:
    """Return a value moved by a step, reflected at the ends of its range."""
    moved = value + step
    if moved > high:
        moved = high + high - moved
    elif moved < low:
        moved = low + low - moved
    return np.float32(min(max(moved, low), high))


@target_motion("accelerating", draw=draw_weave, memory=("weave_amplitude", "weave_rate", "weave_phase"))
def accelerating(c: Record, w: Record) -> None:
    """Turn rate is a sine whose random amplitude and rate walk slowly, within the turn limit (paper, section 2)."""
    limit = c.target_turn_rate
    spread = np.float32(math.sqrt(3.0 * c.control_step))  # of a uniform step of deviation sqrt(dt)
    turn = w.weave_amplitude * np.float32(math.sin(w.weave_phase))
    w.weave_phase += w.weave_rate * c.control_step
    if w.weave_phase >= TWO_PI:
        w.weave_phase -= TWO_PI
    wider = _AMPLITUDE_WALK * limit * spread * between(-1.0, 1.0, w.key, w.step, TARGET, 103)
    w.weave_amplitude = walked(w.weave_amplitude, wider, _LEAST * limit, _MOST * limit)
    faster = _RATE_WALK * spread * between(-1.0, 1.0, w.key, w.step, TARGET, 104)
    w.weave_rate = walked(w.weave_rate, faster, _LEAST_RATE, _MOST_RATE)
    for _ in range(c.physics_steps):  # an arc turns by 1 rad at most
        _, _, w.goal_cos, w.goal_sin = arc(w.goal_cos, w.goal_sin, ZERO, turn, c.physics_step)


@target_motion("agent")
def agent(c: Record, w: Record) -> None:
    """A policy controls the target."""
