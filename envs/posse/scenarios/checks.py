"""Checks of a scenario's settings against each other."""

from __future__ import annotations

import math

from posse.registry import FIELDS, METRICS, REWARD_TERMS
from posse.scenarios.formation import slot_offsets
from posse.scenarios.limits import FARTHEST, LEAST_CHANGE, LONGEST_MOVE, MOST_WEIGHT, SAFE_MARGIN, START_CLEARANCE
from posse.scenarios.scenario import Scenario, checked_by
from posse.scenarios.setting import ScenarioError, fail, is_number
from posse.shown import shown


@checked_by
def check_together(s: Scenario) -> None:
    """Raise where individually valid settings are inconsistent.

    Raises:
        ScenarioError: Names the settings, the limit and the fix.
    """
    _check_each(s)
    _check_motion(s)
    _check_formation(s)
    _check_place(s)
    _check_rounding(s)
    _check_fields(s)
    _check_rewards(s)
    _check_metrics(s)


def _check_each(s: Scenario) -> None:
    for name, setting in s.settings().items():
        value = getattr(s, name)
        if setting.per_tracker and isinstance(value, tuple) and len(value) != s.num_trackers:
            fail(
                name,
                value,
                f"{len(value)} values for num_trackers={s.num_trackers}: give one number, or one for each tracker",
            )


def _check_motion(s: Scenario) -> None:
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
    if s.breaks >= s.num_trackers > 0 and s.breaks > 0:
        fail("breaks", s.breaks, f"at most num_trackers - 1 = {s.num_trackers - 1}")
    if s.break_choice == "given" and s.breaks > 1:
        fail("breaks", s.breaks, 'break_choice="given" names one tracker, break_number')
    if s.break_choice == "given" and s.break_number >= s.num_trackers:
        fail("break_number", s.break_number, f"trackers are 0 to {s.num_trackers - 1}")
    if s.settle_time > s.duration:
        fail(
            "settle_time",
            s.settle_time,
            f"an episode of horizon={s.horizon} steps of {s.control_step:g} s is over before that",
        )


def _check_formation(s: Scenario) -> None:
    offsets = slot_offsets(s)
    apart = min((math.dist(a, b) for i, a in enumerate(offsets) for b in offsets[:i]), default=math.inf)
    if apart <= 2 * s.tolerance + 1e-9:
        raise ScenarioError(
            f"slots of the {s.formation} lie {apart:.3g} m apart, which must be more than twice "
            f"tolerance={s.tolerance:g}: raise formation_spacing={s.formation_spacing:g} "
            "or lower tolerance"
        )
    if apart <= 2 * s.robot_radius:
        raise ScenarioError(
            f"slots of the {s.formation} lie {apart:.3g} m apart, robots of "
            f"robot_radius={s.robot_radius:g} would touch: raise formation_spacing"
        )
    nearest = min(math.hypot(x, y) for x, y in offsets)
    if nearest <= 2 * s.robot_radius:
        raise ScenarioError(
            f"formation_distance={s.formation_distance:g} leaves a slot {nearest:.3g} m from the "
            f"target, which robots of robot_radius={s.robot_radius:g} touch: raise it"
        )


def _check_place(s: Scenario) -> None:
    if s.position_bound > FARTHEST:
        raise ScenarioError(
            f"robots could come {s.position_bound:.3g} m from the origin along an axis, at most "
            f"{FARTHEST:g} m is possible: lower tracker_speed={max(s.tracker_speeds):g}, "
            f"horizon={s.horizon}, control_step={s.control_step:g} or "
            f"start_distance={s.start_distance}, or set an arena"
        )
    if s.start_distance[0] <= 2 * s.robot_radius:
        fail(
            "start_distance",
            s.start_distance,
            f"trackers must start clear of the target, beyond {2 * s.robot_radius:g} m",
        )
    ring = math.pi * (s.start_distance[1] ** 2 - s.start_distance[0] ** 2)
    excluded = s.num_trackers * math.pi * (2 * s.robot_radius + START_CLEARANCE) ** 2
    if not math.isfinite(s.arena):
        if s.num_obstacles:
            raise ScenarioError(f"num_obstacles={s.num_obstacles} needs an arena: set arena to its side in m")
        if excluded > ring:
            raise ScenarioError(
                f"{s.num_trackers} trackers do not fit at start_distance={s.start_distance}: "
                "widen it, or lower num_trackers or robot_radius"
            )
        return
    if s.obstacle_radius[0] <= 0 and s.num_obstacles:
        fail("obstacle_radius", s.obstacle_radius, "radii must be above 0")
    if s.target_extent <= 0 or s.arena / 2 <= s.start_distance[0]:
        raise ScenarioError(
            f"arena={s.arena:g} is too small for start_distance={s.start_distance} and a target "
            f"that needs {s.target_clearance:.3g} m to turn away from a wall: raise arena"
        )
    width = 2 * s.obstacle_radius[1] + s.obstacle_gap
    taken = s.num_obstacles * math.pi * width**2
    if taken > 0.9 * (s.arena - width) ** 2:
        raise ScenarioError(
            f"num_obstacles={s.num_obstacles} of obstacle_radius up to {s.obstacle_radius[1]:g} m "
            f"with obstacle_gap={s.obstacle_gap:g} do not fit in arena={s.arena:g}: "
            "lower their number, radius or gap, or raise arena"
        )
    circle = s.target_speed / s.target_turn_rate + s.robot_radius + SAFE_MARGIN
    blocked = s.num_obstacles * math.pi * (s.obstacle_radius[1] + circle) ** 2
    if s.target_motion != "agent" and blocked > 0.9 * (s.arena - 2 * circle) ** 2:
        raise ScenarioError(
            f"num_obstacles={s.num_obstacles} leave no room for a target that needs {circle:.3g} m "
            f"to turn at target_turn_rate={s.target_turn_rate:g}: lower their number or "
            "target_speed, or raise target_turn_rate or arena"
        )
    room = _room_to_start(s)
    width = s.obstacle_radius[1] + s.robot_radius + START_CLEARANCE
    room *= 1 - min(1, s.num_obstacles * math.pi * width**2 / s.arena**2)
    if excluded > room:
        raise ScenarioError(
            f"{s.num_trackers} trackers do not fit at start_distance={s.start_distance} in "
            f"arena={s.arena:g}: widen them, or lower num_trackers or robot_radius"
        )


def _room_to_start(s: Scenario) -> float:
    """Return the area within the walls where trackers may start, for the worst target position, m².

    Summed over a grid of distances and bearings.
    """
    least, most = s.start_distance
    inner = s.arena / 2 - s.robot_radius - START_CLEARANCE
    distances = [least + (most - least) * (k + 0.5) / 16 for k in range(16)]
    bearings = [2 * math.pi * (k + 0.5) / 64 for k in range(64)]
    areas = []
    for at in (0.0, s.target_extent):  # centre and corner
        area = 0.0
        for d in distances:
            inside = sum(abs(at + d * math.cos(b)) <= inner and abs(at + d * math.sin(b)) <= inner for b in bearings)
            area += inside / 64 * 2 * math.pi * d * (most - least) / 16
        areas.append(area)
    return min(areas)


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
    slowest, most_turn = min(s.tracker_speeds), max(s.tracker_turn_rates)
    for name, value, added_to, most in (
        ("tracker_speed", slowest, "a position", s.position_bound),
        ("target_speed", s.target_speed, "a position", s.position_bound),
        ("tracker_turn_rate", min(s.tracker_turn_rates), "a heading", 1.0),
        ("target_turn_rate", s.target_turn_rate, "a heading", 1.0),
        ("tracker_acceleration", s.tracker_acceleration, "a speed", fastest),
        ("tracker_turn_acceleration", s.tracker_turn_acceleration, "a turn rate", most_turn),
    ):
        least = LEAST_CHANGE * _spacing(most) / s.physics_step
        if 0 < value < least:
            raise ScenarioError(
                f"{name}={value:g} adds {value * s.physics_step:.3g} to {added_to} of up to "
                f"{most:.3g} in a physics step, which float32 loses to rounding: choose {name} >= "
                f"{least:.3g}, or a longer physics_step={s.physics_step:g}"
            )
    outermost = max(math.hypot(x, y) for x, y in slot_offsets(s))
    if outermost > FARTHEST:
        raise ScenarioError(
            f"formation_spacing={s.formation_spacing:g} and "
            f"formation_distance={s.formation_distance:g} put a slot {outermost:.3g} m from the "
            f"target, at most {FARTHEST:g} m is possible: lower them or num_trackers"
        )


def _spacing(value: float) -> float:
    """Return the spacing of float32 at a number."""
    return math.ulp(value) * 2.0**29  # a double has 29 more bits


def _check_fields(s: Scenario) -> None:
    for k, name in enumerate(s.extra_fields):
        if name not in FIELDS:
            raise ScenarioError(f"in extra_fields: {FIELDS.unknown(name)}")
        if FIELDS.is_built_in(name):
            fail("extra_fields", s.extra_fields, f"{name!r} is in every observation: leave it out")
        if name in s.extra_fields[:k]:
            fail("extra_fields", s.extra_fields, f"{name!r} is there twice")


def _check_rewards(s: Scenario) -> None:
    _check_weights("reward_weights", dict(s.reward_weights))
    _check_weights("target_reward_weights", dict(s.target_reward_weights))
    for name in dict(s.target_reward_weights):
        if REWARD_TERMS[name].of_target is None:
            known = [term for term in REWARD_TERMS if REWARD_TERMS[term].of_target is not None]
            raise ScenarioError(
                f"in target_reward_weights: {name!r} is a term of trackers only; a target has: {', '.join(known)}"
            )


def _check_weights(setting: str, weights: dict[str, float]) -> None:
    for name, weight in weights.items():
        if name not in REWARD_TERMS:
            raise ScenarioError(f"in {setting}: {REWARD_TERMS.unknown(name)}")
        if not is_number(weight) or not math.isfinite(weight):
            fail(f"{setting}[{shown(name)}]", weight, "a weight must be a finite number")
        if abs(weight) > MOST_WEIGHT:
            fail(
                f"{setting}[{shown(name)}]",
                weight,
                f"a weight must lie in [-{MOST_WEIGHT:g}, {MOST_WEIGHT:g}]: scale all of them",
            )


def _check_metrics(s: Scenario) -> None:
    for name in s.metrics:
        if name not in METRICS:
            raise ScenarioError(f"metrics={shown(s.metrics)}: {METRICS.unknown(name)}")
