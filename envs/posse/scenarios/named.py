"""The named scenarios of the benchmark: what each sets differently from the defaults."""

from typing import Any, Final

from posse.declarations import unknown
from posse.scenarios.scenario import Scenario
from posse.scenarios.setting import ScenarioError

_PAPER: Final[dict[str, Any]] = {
    "meaning": "Section 4 of the paper: 8 s from near starts, fast trackers, a slow target that runs straight.",
    "horizon": 80,
    "start_distance": (0.6, 1.8),
    "tracker_speed": 1.5,
    "tracker_turn_rate": 3.0,
    "target_speed": 0.5,
    "formation_distance": 0.8,
    "formation_spacing": 0.8,
    "tolerance": 0.2,
}

# A TurtleBot3 Waffle Pi in true metres. Speeds, width and wheels: ROBOTIS e-manual, "Specifications". Its 1.82 rad/s on
# the spot would take wheels of 0.261 m/s. Accelerations, and the 10 Hz that are the default control step:
# dwa_local_planner_params_waffle_pi.yaml of ROBOTIS.
_WAFFLE_PI: Final[dict[str, Any]] = {
    "tracker_speed": 0.26,
    "tracker_turn_rate": 1.8,
    "tracker_acceleration": 2.5,
    "tracker_turn_acceleration": 3.2,
    "wheel_base": 0.287,
    "robot_radius": 0.153,  # half of its width of 0.306 m
    # Assumptions, no data of the maker's.
    "actuator_lag": 0.2,  # 0.1 to 0.3 s are usual for small wheeled robots
    "command_delay": 2,  # a step to measure and tell, a step to decide
    "odometry_drift": 0.02,  # 0.15 m in an episode: 1 to 2 % of the way
    "heading_drift": 0.005,  # 2.2° in an episode
    "heading_noise": 0.05,  # 3°: a marker on the target, seen by a camera from some metres
}

# The reasons for these settings are in docs/scenarios.md.
SCENARIOS: Final[dict[str, dict[str, Any]]] = {
    "constant": {"meaning": "The target runs straight on; everybody sees it and hears everybody: a sanity check."},
    "accelerating": {
        "version": 2,
        "meaning": "The target weaves: its turn rate is a sine, drawn for each world.",
        "target_motion": "accelerating",
    },
    "smart": {
        "meaning": "The target turns faster than the trackers, flees through the widest gap, and darts.",
        "target_motion": "smart",
        "tracker_turn_rate": 1.2,
        "target_turn_rate": 2.0,
    },
    "search": {
        "version": 3,
        "meaning": "Sight is short: the team has to spread out in an arena, find the target, and tell the others.",
        "target_motion": "accelerating",
        "tracker_turn_rate": 1.2,
        "target_turn_rate": 1.2,
        "arena": 20.0,
        "start_distance": (4.0, 20.0),
        "sensing_range": 3.0,
    },
    "obstacles": {
        "version": 2,
        "meaning": "Discs block paths and the view in a walled arena, and the target is smart.",
        "target_motion": "smart",
        "tracker_turn_rate": 1.8,
        "target_turn_rate": 1.8,
        "arena": 20.0,
        "num_obstacles": 8,
    },
    "radio": {
        "version": 2,
        "meaning": "Sight is too short without communication; messages are late, three in ten are lost.",
        "target_motion": "smart",
        "tracker_turn_rate": 1.5,
        "target_turn_rate": 2.0,
        "start_distance": (2.0, 5.0),
        "sensing_range": 4.0,
        "radio_range": 6.0,
        "radio_delay": 3,
        "radio_loss": 0.3,
    },
    "leader-loss": {
        "version": 2,
        "meaning": "Only the first slot has the target in sight; its tracker breaks, and another must lead.",
        "target_motion": "accelerating",
        "tracker_turn_rate": 1.1,
        "target_turn_rate": 0.2,
        "formation_distance": 2.4,
        "formation_spacing": 2.4,
        "start_distance": (2.0, 3.9),
        "sensing_range": 4.0,
        "breaks": 1,
        "horizon": 300,
    },
    "field": {
        "version": 3,
        "meaning": "Search, obstacles, noise, a lossy radio, a broken robot, outages, and a smart target.",
        "target_motion": "smart",
        "tracker_turn_rate": 1.5,
        "target_turn_rate": 1.5,
        "arena": 24.0,
        "num_obstacles": 6,
        "start_distance": (4.0, 20.0),
        "sensing_range": 6.0,
        "range_noise": 0.02,
        "bearing_noise": 0.02,
        "velocity_smoothing": 0.5,
        "radio_range": 8.0,
        "radio_delay": 2,
        "radio_loss": 0.2,
        "breaks": 1,
        "break_choice": "drawn",
        "sensor_outages": 0.2,
        "radio_outages": 0.2,
    },
    "duel": {
        "version": 3,
        "meaning": "Two sides that both can learn; the target has 4/5 of the trackers' speed, 3/4 of their turn rate.",
        "target_speed": 0.8,
        "target_motion": "smart",
        "tracker_turn_rate": 2.0,
        "target_turn_rate": 1.5,
        "target_reward_weights": {"team": -1.0, "contact": -0.2},
    },
    "robots": {
        "meaning": "Small robots on two wheels, whose poses drift and whose commands act late, and a smart target.",
        **_WAFFLE_PI,
        "target_motion": "smart",
        "target_speed": 0.156,
        "target_turn_rate": 0.7,
        "formation_distance": 0.8,
        "formation_spacing": 0.8,
        "tolerance": 0.15,
        "start_distance": (1.0, 2.6),
    },
    "paper-centralized": _PAPER,
    "paper-distributed": _PAPER,
}


def scenario_names() -> tuple[str, ...]:
    """Return the names of all scenarios."""
    return tuple(SCENARIOS)


def get_scenario(scenario: str | Scenario, **overrides: Any) -> Scenario:
    """Return a scenario by name, or the given one, with fields overridden; ScenarioError for an unknown name or field.

    Args:
        scenario: Its name, or a scenario.
        overrides: Any field of :class:`posse.Scenario`.
    """
    if isinstance(scenario, Scenario):
        found = scenario
    elif isinstance(scenario, str) and scenario in SCENARIOS:  # type: ignore[redundant-expr]
        found = Scenario(name=scenario, **SCENARIOS[scenario])
    else:
        families = "; families, as those of posse.family_names(), are for posse.batches, compare, tune and train"
        raise ScenarioError(unknown("scenario", scenario, SCENARIOS) + families)
    return found.replace(**overrides) if overrides else found
