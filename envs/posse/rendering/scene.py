"""The contents of a frame, read from a batch, and their recent past; drawing reads no records."""

import math
from typing import Final

import numpy as np

from posse.engine.batch import Batch
from posse.rendering.camera import Points
from posse.rules.state import NEVER

_LINK_SHOWN: Final = 3  # control steps after a message
_TRAIL_TIME: Final = 6.0  # s
_MARK_TIME: Final = 0.2  # s, between two marks of a trail
_FLASH_TIME: Final = 0.8  # s


class Scene:
    """One world at one time. N trackers, M obstacles; metres, seconds, radians.

    Arguments and errors are those of :meth:`posse.rendering.renderer.Renderer.draw`.
    """

    def __init__(self, batch: Batch, world: int) -> None:
        if not 0 <= world < batch.num_worlds:
            raise ValueError(f"world={world} is not in the batch: it holds worlds 0 to {batch.num_worlds - 1}")
        batch.check_started("draw")
        of = {name: array[world] for name, array in batch.state.items()}
        s, n = batch.scenario, batch.scenario.num_trackers

        def points(*names: str) -> Points:
            return np.stack([of[name] for name in names], axis=-1).astype(np.float64)

        self.scenario = s
        self.episode = int(of["world_key"])
        self.step = int(of["world_step"])
        self.time = self.step * s.control_step
        self.score = float(of["world_score_sum"]) / max(self.step, 1)  # mean over the steps so far

        self.target = points("world_x", "world_y")  # (2,)
        self.target_heading = points("world_heading_cos", "world_heading_sin")
        self.frame = points("world_frame_cos", "world_frame_sin")  # of the slots
        cosine, sine = self.frame
        self.slots = self.target + np.array(s.slot_offsets) @ np.array([[cosine, sine], [-sine, cosine]])  # (N, 2)
        self.occupied = np.isin(np.arange(n), of["tracker_slot"])  # (N,) by slot

        self.position = points("tracker_x", "tracker_y")  # (N, 2)
        self.heading = points("tracker_heading_cos", "tracker_heading_sin")  # (N, 2)
        self.broken = of["tracker_broken_at"] != NEVER  # (N,)
        self.sees = of["tracker_sees"] != 0  # (N,) its own sensor sees the target
        since = self.step - of["tracker_sensor_dead_from"].astype(np.int64)
        self.senses = ~self.broken & ((since < 0) | (since >= s.outage_steps))  # (N,) its sensor works
        self.touched = of["tracker_onsets"] > 0  # (N,) a contact began in this step
        heard = of["heard_step"] > max(self.step - s.radio_delay - _LINK_SHOWN, -1)  # just now
        self.links = heard | heard.T  # (N, N); (0, 0) where the radio is perfect
        self.obstacles = points("obstacle_x", "obstacle_y", "obstacle_radius")  # (M, 3)

    @property
    def in_view(self) -> Points:
        """Points (K, 2) that a camera keeps in view.

        Broken trackers stay behind: a view that included them would grow without bound.
        """
        return np.vstack([self.position[~self.broken], self.target, self.target + self.frame])


class History:
    """The scenes of the last seconds of an episode, for trails and contacts. Cleared when another one starts."""

    def __init__(self) -> None:
        self._scenes: list[Scene] = []

    def note(self, scene: Scene) -> float:
        """Record a state; return the time since the last one, s; inf: in a new episode.

        A state recorded twice counts once; an earlier one (a restored batch) clears the history.
        """
        last = self._scenes[-1] if self._scenes else None
        if last is None or scene.episode != last.episode or scene.step < last.step:
            self._scenes = [scene]
            return math.inf
        kept = [s for s in self._scenes if s.step < scene.step and scene.time - s.time <= _TRAIL_TIME]
        self._scenes = [*kept, scene]
        return scene.time - last.time

    def trail(self) -> list[tuple[Points, float]]:
        """Return past places (N + 1, 2) m, the target last, and freshness: 1 now, 0 at the end. Oldest first."""
        now = self._scenes[-1]
        every = max(1, round(_MARK_TIME / now.scenario.control_step))
        marks = [s for s in self._scenes if s.step % every == 0 or s is now]
        return [(np.vstack([s.position, s.target]), 1 - (now.time - s.time) / _TRAIL_TIME) for s in marks]

    def flashes(self) -> list[tuple[Points, float]]:
        """Return place (2,) m and age, 0 now, 1 at the end, of the contacts that have just begun."""
        now = self._scenes[-1].time
        recent = [s for s in self._scenes if now - s.time < _FLASH_TIME]
        return [(place, (now - s.time) / _FLASH_TIME) for s in recent for place in s.position[s.touched]]
