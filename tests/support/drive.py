"""Policies driven through the public interface from given poses; a test may steer the target."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

import posse
from posse_baselines import Policy, begin, load
from posse_baselines.playing import poses_of

Floats = npt.NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Instant:
    """Poses before a step, the team's annotations, and its commands."""

    time: float  # s
    tracker: Floats  # (E, N, 3), x, y, θ
    target: Floats  # (E, 3)
    psi: Floats  # (E,), heading of the slot frame
    notes: dict[str, Any]  # the policy's annotations, (E, N) each
    commands: Floats  # (E, N, 2), V in m/s and ω in rad/s
    broken: npt.NDArray[np.bool_]  # (E, N)

    @property
    def line_of_sight(self) -> npt.NDArray[np.complex128]:
        """From each tracker to the target, as complex numbers, (E, N)."""
        return complex_of(self.target)[:, None] - complex_of(self.tracker)


def complex_of(poses: Floats) -> npt.NDArray[np.complex128]:
    """Positions of poses (..., 3) in the complex plane."""
    return np.asarray(poses[..., 0] + 1j * poses[..., 1], np.complex128)


def drive(
    policy: str | Policy,
    scenario: str,
    worlds: int,
    steps: int,
    *,
    tracker_pose: Any = None,
    target_pose: Any = None,
    target: Callable[[float], tuple[float, float]] | None = None,
    **settings: Any,
) -> Iterator[Instant]:
    """Play ``steps`` control steps; ``target`` gives its (V, ω) where a test steers it."""
    team = load(policy) if isinstance(policy, str) else policy
    if target is not None:
        settings["target_motion"] = "agent"
    settings = {"message_size": team.message_size, "horizon": steps + 1000, **settings}
    batch = posse.batch(scenario, worlds, seed=0, autoreset="disabled", **settings)
    observations = batch.reset(options={"tracker_pose": tracker_pose, "target_pose": target_pose})
    memory, s = begin(team, batch), batch.scenario
    limits = np.stack([0.5 * np.array(s.tracker_speeds), s.tracker_turn_rates], -1)
    for step in range(steps):
        state, given = batch.state, observations[:, : s.num_trackers]
        team_actions, memory = team.act(given, memory)
        actions = np.zeros(batch.action_shape, np.float32)
        actions[:, : s.num_trackers] = team_actions
        if target is not None:
            speed, omega = target(step * s.control_step)
            actions[:, -1, 0] = 2.0 * speed / s.target_speed - 1.0
            actions[:, -1, 1] = omega / s.target_turn_rate
        yield Instant(
            step * s.control_step,
            poses_of(state, "tracker").astype(np.float64),
            poses_of(state, "world").astype(np.float64),
            np.arctan2(state["world_frame_sin"], state["world_frame_cos"]),
            team.annotations(memory),
            (team_actions[..., :2].astype(np.float64) + np.array([1.0, 0.0])) * limits,
            batch.layout.views(given)["working"] == 0.0,
        )
        observations, *_ = batch.step(actions)
