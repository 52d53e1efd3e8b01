"""The observation of one tracker."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from tests.support.reference.senses import Senses, sonar
from tests.support.reference.state import TOUCHING, Array, State, free_gaps, headings, positions, working

import posse
from posse.scenarios.scenario import FORMATIONS


def observation(s: posse.Scenario, state: State, i: int, senses: Senses, told: npt.NDArray[Any]) -> dict[str, Array]:
    """Return the observation of tracker i by field name, as ``ObservationLayout.views``.

    ``told`` holds the numbers of the team-mates in the engine's order, for those equally far.
    """
    p, h, step = positions(state)[i], headings(state)[i], int(state["world_step"])

    def pair(z: complex) -> Array:
        return np.array([z.real, z.imag])

    def place(z: complex) -> tuple[float, Array]:
        away = (z - p) / h
        return abs(away), pair(away / abs(away)) if away else np.array([1.0, 0.0])

    fix = senses.fixes[i]
    known = fix.step >= 0
    target_range, target_bearing = place(fix.place) if known else (-1.0, np.zeros(2))
    values: dict[str, Any] = {
        "heading": pair(h),
        "position": pair(p),
        "speed": state["tracker_speed"][i],
        "turn_rate": state["tracker_turn_rate"][i],
        "touching": float((free_gaps(s, state)[i] <= TOUCHING).any()),
        "working": float(working(state)[i]),
        "formation": np.array([float(name == s.formation) for name in FORMATIONS]),
        "number": i,
        "team_size": s.num_trackers,
        "formation_distance": s.formation_distance,
        "formation_spacing": s.formation_spacing,
        "max_speed": s.tracker_speeds[i],
        "max_turn_rate": s.tracker_turn_rates[i],
        "acceleration_time": s.tracker_speeds[i] / s.tracker_acceleration,
        "turn_acceleration_time": s.tracker_turn_rates[i] / s.tracker_turn_acceleration,
        "tolerance": s.tolerance,
        "robot_radius": s.robot_radius,
        "control_step": s.control_step,
        "sensing_range": s.sensing_range if math.isfinite(s.sensing_range) else -1,
        "sonar_range": s.sonar_range,
        "arena": 2 * s.half_sides[0] if s.walled else -1,
        **({"arena_height": 2 * s.half_sides[1]} if isinstance(s.arena, tuple) else {}),
        "time_left": (s.horizon - step) * s.control_step,
        "target_known": float(known),
        "target_seen": float(senses.sees[i]),
        "target_age": (step - fix.step) * s.control_step if known else -1.0,
        "target_range": target_range,
        "target_bearing": target_bearing,
        "target_heading": pair(fix.heading / h) if known else np.zeros(2),
        "target_frame": pair(fix.frame / h) if known else np.zeros(2),
        "target_velocity": pair(fix.velocity / h) if known else np.zeros(2),
    }
    if s.sonar_beams:
        values["sonar"] = sonar(s, state, i)
        if s.sonar_beams == 1:
            values["sonar"] = values["sonar"][0]
    k, m = s.neighbours, s.message_size
    mates: dict[str, Array] = {
        "number": np.full(k, -1.0),
        "age": np.full(k, -1.0),
        "range": np.full(k, -1.0),
        "bearing": np.zeros((k, 2)),
        "heading": np.zeros((k, 2)),
        "speed": np.zeros(k),
        "turn_rate": np.zeros(k),
        "message": np.zeros((k, m)),
    }
    recent = [
        (abs(words.place - p), j, words)
        for (listener, j), words in senses.heard.items()
        if listener == i and (step - words.step) * s.control_step <= s.forget_after + 1e-6
    ]
    spots = {int(number): spot for spot, number in enumerate(told)}
    recent.sort(key=lambda found: (spots.get(found[1], k), found[0]))
    assert (np.diff([found[0] for found in recent]) > -1e-5).all(), "nearest first, as told"
    for spot, (_, j, words) in enumerate(recent[:k]):
        mates["number"][spot] = j
        mates["age"][spot] = (step - words.step) * s.control_step
        mates["range"][spot], mates["bearing"][spot] = place(words.place)
        mates["heading"][spot] = pair(words.heading / h)
        mates["speed"][spot], mates["turn_rate"][spot] = words.speed, words.turn_rate
        mates["message"][spot] = words.message
    if m == 0:
        del mates["message"]
    elif m == 1:
        mates["message"] = mates["message"][:, 0]
    values.update({f"neighbour_{name}": value for name, value in mates.items()})
    return {name: np.asarray(value, np.float64) for name, value in values.items()}
