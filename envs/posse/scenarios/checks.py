"""Checks of a scenario's settings against each other."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from posse.registry import FIELDS, METRICS, REWARD_TERMS
from posse.scenarios.formation import slot_offsets
from posse.scenarios.limits import FARTHEST, LEAST_CHANGE, LONGEST_MOVE
from posse.scenarios.setting import ScenarioError, fail
from posse.shown import unknown

if TYPE_CHECKING:
    from posse.scenarios.scenario import Scenario


def check_together(s: Scenario) -> None:
    """Raise where individually valid settings are inconsistent.

    Whether a start can be drawn is found at the reset (:func:`posse.rules.start.check_drawn`).

    Raises:
        ScenarioError: Names the settings, the limit and the fix.
    """
    _check_team(s)
    _check_time(s)
    _check_formation(s)
    _check_arena(s)
    _check_rounding(s)
    _check_declarations(s)


def _check_team(s: Scenario) -> None:
    for name, setting in s.settings().items():
        each = getattr(s, name)
        if setting.per_tracker and isinstance(each, tuple) and len(each) != s.num_trackers:
            fail(name, each, f"{len(each)} values for num_trackers={s.num_trackers}: give one number, or one for each")
    slowest = min(s.tracker_speeds)
    if s.target_speed > 0.9999 * slowest:
        raise ScenarioError(
            f"target_speed={s.target_speed:g} must be below tracker_speed={slowest:g}, by "
            "0.01 % at least: a slower team cannot catch up (paper, assumption ii)"
        )
    if s.target_least_speed > s.target_speed:
        fail("target_least_speed", s.target_least_speed, f"it must be at most target_speed={s.target_speed:g}")
    if s.target_speed == 0 and s.target_motion != "constant":
        fail("target_speed", s.target_speed, "only a target of constant motion may rest")
    if s.breaks and s.breaks >= s.num_trackers:
        fail("breaks", s.breaks, f"at most num_trackers - 1 = {s.num_trackers - 1}")
    if s.break_choice == "given" and s.breaks > 1:
        fail("breaks", s.breaks, 'break_choice="given" names one tracker, break_number')
    if s.break_choice == "given" and s.break_number >= s.num_trackers:
        fail("break_number", s.break_number, f"trackers are 0 to {s.num_trackers - 1}")


def _check_time(s: Scenario) -> None:
    steps = s.control_step / s.physics_step
    if abs(steps - round(steps)) > 1e-6 or round(steps) < 1:
        raise ScenarioError(
            f"control_step={s.control_step:g} must be a whole multiple of physics_step={s.physics_step:g}"
        )
    for name, rate in (("tracker_turn_rate", max(s.tracker_turn_rates)), ("target_turn_rate", s.target_turn_rate)):
        turn = rate * s.physics_step
        if turn > 1.0:
            raise ScenarioError(
                f"{name}={rate:g} turns {turn:.2f} rad in a physics step, at most 1 is "
                f"possible: choose physics_step <= {1 / rate:.3g}"
            )
    if s.settle_time > s.duration:
        raise ScenarioError(
            f"settle_time={s.settle_time:g} s is longer than an episode of horizon={s.horizon} steps of "
            f"{s.control_step:g} s: set settle_time to at most {s.duration:g}, or raise horizon"
        )


def _check_formation(s: Scenario) -> None:
    offsets = slot_offsets(s)
    apart = min((math.dist(a, b) for i, a in enumerate(offsets) for b in offsets[:i]), default=math.inf)
    if apart <= 2 * max(s.tolerance, s.robot_radius) + 1e-9:
        raise ScenarioError(
            f"slots of the {s.formation} lie {apart:.3g} m apart, which must be more than twice "
            f"tolerance={s.tolerance:g} and robot_radius={s.robot_radius:g}: raise "
            f"formation_spacing={s.formation_spacing:g} or lower them"
        )
    distances = [math.hypot(x, y) for x, y in offsets]
    if min(distances) <= 2 * s.robot_radius:
        raise ScenarioError(
            f"formation_distance={s.formation_distance:g} leaves a slot {min(distances):.3g} m from the "
            f"target, which robots of robot_radius={s.robot_radius:g} touch: raise it"
        )
    if max(distances) > FARTHEST:
        raise ScenarioError(
            f"formation_spacing={s.formation_spacing:g} and formation_distance={s.formation_distance:g} put a slot "
            f"{max(distances):.3g} m from the target, at most {FARTHEST:g} m is possible: lower them or num_trackers"
        )


def _check_arena(s: Scenario) -> None:
    if s.position_bound > FARTHEST:
        raise ScenarioError(
            f"robots could come {s.position_bound:.3g} m from the origin along an axis, at most "
            f"{FARTHEST:g} m is possible: lower tracker_speed={max(s.tracker_speeds):g}, "
            f"horizon={s.horizon}, control_step={s.control_step:g} or "
            f"start_distance={s.start_distance}, or set an arena"
        )
    if s.start_distance[0] <= 2 * s.robot_radius:
        nearest = 2 * s.robot_radius
        fail("start_distance", s.start_distance, f"trackers must start clear of the target, beyond {nearest:g} m")
    if s.num_obstacles and math.isinf(s.arena):
        raise ScenarioError(f"num_obstacles={s.num_obstacles} needs an arena: set arena to its side in m")
    if s.num_obstacles and s.obstacle_radius[0] <= 0:
        fail("obstacle_radius", s.obstacle_radius, "radii must be above 0")
    if s.target_extent <= 0:
        raise ScenarioError(
            f"arena={s.arena:g} is too small for a target that needs {s.target_clearance:.3g} m to turn away from a "
            "wall: raise arena or target_turn_rate, or lower target_speed"
        )


def _check_rounding(s: Scenario) -> None:
    """Raise where float32 in the kernels would be too coarse for the scenario."""
    fastest = max(s.tracker_speeds)
    move, longest = fastest * s.physics_step, math.sqrt(LONGEST_MOVE * s.robot_radius)
    if move > longest:
        raise ScenarioError(
            f"tracker_speed={fastest:g} moves {move:.3g} m in a physics step, contact of "
            f"robots of robot_radius={s.robot_radius:g} is exact up to {longest:.3g} m: choose "
            f"physics_step <= {longest / fastest:.3g}"
        )
    for name, value, added_to, most in (
        ("tracker_speed", min(s.tracker_speeds), "a position", s.position_bound),
        ("target_speed", s.target_speed, "a position", s.position_bound),
        ("tracker_turn_rate", min(s.tracker_turn_rates), "a heading", 1.0),
        ("target_turn_rate", s.target_turn_rate, "a heading", 1.0),
        ("tracker_acceleration", s.tracker_acceleration, "a speed", fastest),
        ("tracker_turn_acceleration", s.tracker_turn_acceleration, "a turn rate", max(s.tracker_turn_rates)),
    ):
        spacing = math.ulp(most) * 2.0**29  # of float32: a double has 29 more bits
        least = LEAST_CHANGE * spacing / s.physics_step
        if 0 < value < least:
            raise ScenarioError(
                f"{name}={value:g} adds {value * s.physics_step:.3g} to {added_to} of up to "
                f"{most:.3g} in a physics step, which float32 loses to rounding: choose {name} >= "
                f"{least:.3g}, or a longer physics_step={s.physics_step:g}"
            )


def _check_declarations(s: Scenario) -> None:
    for setting, names, known in (
        ("extra_fields", s.extra_fields, FIELDS),
        ("metrics", s.metrics, METRICS),
        ("reward_weights", dict(s.reward_weights), REWARD_TERMS),
        ("target_reward_weights", dict(s.target_reward_weights), REWARD_TERMS),
    ):
        for name in names:
            if name not in known:
                raise ScenarioError(f"in {setting}: {known.unknown(name)}")
    for name in filter(FIELDS.is_built_in, s.extra_fields):
        fail("extra_fields", s.extra_fields, f"{name!r} is in every observation: leave it out")
    of_target = [name for name, term in REWARD_TERMS.items() if term.of_target is not None]
    for name in dict(s.target_reward_weights):
        if name not in of_target:
            raise ScenarioError(f"in target_reward_weights: {unknown('term of a target', name, of_target)}")
