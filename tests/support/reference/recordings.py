"""Recorded episodes that the computation is compared with."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from tests.support.reference.score import slots
from tests.support.reference.state import NAMES, State, headings, one_world, positions, snapshot

import posse


@dataclass
class Recording:
    """An episode of one world: inputs and outputs of every step."""

    batch: posse.Batch
    states: list[State]
    actions: list[npt.NDArray[np.float32]]
    observations: list[npt.NDArray[np.float32]]
    rewards: list[npt.NDArray[np.float32]]
    infos: list[dict[str, Any]]

    @property
    def scenario(self) -> posse.Scenario:
        return self.batch.scenario


Case = tuple[str, tuple[tuple[str, Any], ...]]
"""A scenario and its changed settings."""


def _case(name: str, **settings: Any) -> Case:
    return name, tuple(settings.items())


CASES: tuple[Case, ...] = (
    *map(_case, NAMES),
    # A ring so tight that trackers run into the target.
    _case("constant", num_trackers=12, num_neighbours=3, message_size=2, formation="ring", formation_spacing=0.65),
    _case("constant", num_trackers=3, num_neighbours=8, message_size=1),
    _case(
        "obstacles",
        tracker_speed=(1.0, 0.8, 1.3, 0.7, 1.0),
        tracker_turn_rate=(1.2, 2.0, 1.0, 1.5, 0.8),
        tracker_acceleration=2.0,
    ),
    _case("constant", num_trackers=1),
    _case("constant", num_trackers=26, num_neighbours=5, formation="ring", message_size=1),
    _case("constant", breaks=2, formation="ring", break_window=(0.2, 0.4)),
    _case("field", num_trackers=9, num_neighbours=3, message_size=2),
    _case("field", breaks=3, field_of_view=2.0, forget_after=0.35),
    _case("radio", num_trackers=2, formation="ring", sonar_beams=1),
    _case("radio", num_trackers=7, formation="rows", sonar_beams=0),
)
"""Every scenario, and variants of settings, to be recorded and computed independently."""


def case_name(case: Case) -> str:
    return "-".join([case[0], *(f"{key}={value}" for key, value in case[1])])


@functools.cache
def record(name: str, overrides: tuple[tuple[str, Any], ...] = (), steps: int = 160) -> Recording:
    """Return an episode in which the team moves roughly to its slots.

    Short, and from starts nearby, so that much happens: contacts, settling, breaks, recovery.
    """
    settings: dict[str, Any] = {
        "horizon": steps,
        "start_distance": (1.5, 5.0),
        "settle_time": 0.5,
        "outage_time": 3.0,
        **dict(overrides),
    }
    batch = posse.batch(name, 1, seed=8, **settings)
    s, n = batch.scenario, batch.scenario.num_trackers
    rng = np.random.default_rng(0)
    observations = [batch.reset()]
    states = [one_world(snapshot(batch), 0)]
    recording = Recording(batch, states, [], observations, [], [])
    for _ in range(steps):
        p, h = positions(states[-1]), headings(states[-1])
        frame = complex(states[-1]["world_frame_cos"], states[-1]["world_frame_sin"])
        away = (p[n] + slots(s) * frame - p[:n]) / h[:n]
        actions = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
        bearing = np.angle(away)
        speed = 0.85 * s.target_speed + 0.8 * np.abs(away) * np.cos(bearing)
        actions[0, :n, 0] = np.clip(2 * speed / s.tracker_speed - 1, -1, 1)
        actions[0, :n, 1] = np.clip(2 * bearing / s.tracker_turn_rate, -1, 1)
        observed, rewards, _, _, infos = batch.step(actions)
        states.append(one_world(snapshot(batch), 0))
        recording.actions.append(actions[0])
        observations.append(observed)
        recording.rewards.append(rewards[0])
        recording.infos.append(infos)
    return recording
