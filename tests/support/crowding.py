"""Teams that chase and crowd the target, and an independent computation of overlaps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

import posse

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]

TOLERANCE = 1e-4  # m


def points(batch: posse.Batch, name: str, x: str = "x", y: str = "y") -> Complexes:
    """Return positions x + iy of the state array ``name``, in float64."""
    state = batch.state
    return np.asarray(state[f"{name}_{x}"].astype(np.float64) + 1j * state[f"{name}_{y}"])


def headings(batch: posse.Batch, name: str) -> Complexes:
    return points(batch, name, "heading_cos", "heading_sin")


def depth(batch: posse.Batch) -> Floats:
    """Return the deepest overlap of a disc with another or a wall in each world, (E,) m."""
    s = batch.scenario
    robots = np.concatenate([points(batch, "tracker"), points(batch, "world")[:, None]], axis=1)
    apart = np.abs(robots[:, :, None] - robots[:, None, :])
    apart[:, np.arange(s.num_trackers + 1), np.arange(s.num_trackers + 1)] = np.inf
    deepest = 2 * s.robot_radius - apart.min(axis=(1, 2))
    for half, at in zip(s.half_sides, (robots.real, robots.imag), strict=True):
        deepest = np.maximum(deepest, np.abs(at).max(axis=1) + s.robot_radius - half)
    if s.num_obstacles:
        apart = np.abs(robots[:, :, None] - points(batch, "obstacle")[:, None, :])
        widths = batch.state["obstacle_radius"].astype(np.float64)[:, None, :] + s.robot_radius
        deepest = np.maximum(deepest, (widths - apart).max(axis=(1, 2)))
    return np.asarray(deepest)


class Team:
    """All trackers at full speed: to the target, or side by side in front of it; sometimes away.

    How far in front, and how wide, is drawn for each world.

    Args:
        batch: What it plays.
        crowds: Whether it goes in front of the target.
        stays: For how long at a time, s.
        leaves: For how long it then keeps away, s.
    """

    def __init__(self, batch: posse.Batch, seed: int, *, crowds: bool, stays: float, leaves: float) -> None:
        n, step = batch.scenario.num_trackers, batch.scenario.control_step
        self.batch = batch
        self.rng = np.random.default_rng(seed)
        ahead = self.rng.uniform(0.0, 0.8, (batch.num_worlds, 1))
        aside = self.rng.uniform(0.0, 1.2, (batch.num_worlds, 1)) * np.linspace(-1, 1, n)
        self.goal = crowds * (ahead + 1j * aside)
        self.stays, self.period = stays / step, (stays + leaves) / step
        self.step = 0

    def play(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Take one control step; return observations and rewards.

        A target that is an agent does as it likes.
        """
        batch, s, n = self.batch, self.batch.scenario, self.batch.scenario.num_trackers
        trackers, target = points(batch, "tracker"), points(batch, "world")
        goal = target[:, None] + headings(batch, "world")[:, None] * self.goal
        if self.step % self.period >= self.stays:
            goal = 2 * trackers - target[:, None]
        bearing = np.angle((goal - trackers) / headings(batch, "tracker"))
        actions = self.rng.uniform(-1, 1, batch.action_shape)
        actions[:, :n, 0] = 1.0
        actions[:, :n, 1] = np.clip(bearing / (s.control_step * np.array(s.tracker_turn_rates)), -1, 1)
        observations, rewards, *_ = batch.step(actions)
        self.step += 1
        return observations, rewards
