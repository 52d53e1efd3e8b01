"""The state of a world as a centralized critic reads it, whatever the trackers can observe.

All vectors are in the target's slot frame (ahead, left), so that the state does not depend on the
position in the plane. The tracker whose value is estimated comes first, the others by number.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from posse import Batch, Scenario
from posse.declarations import plain
from posse.numeric import FloatArray
from posse.rules import NEVER, in_frame

TARGET_SIZE: Final = 6
TRACKER_SIZE: Final = 11
OBSTACLE_SIZE: Final = 3
_POSE: Final = ("x", "y", "heading_cos", "heading_sin", "speed", "turn_rate")
_READ: Final = (*_POSE, "broken_at", "slot", "slot_distance", "sees", "touching")


class StateReader:
    """Reads the state of a batch's worlds, once for each tracker.

    Args:
        batch: The worlds; ValueError if a policy inside the batch moves trackers.
        scenarios: States have places for the most trackers and obstacles that any of these has; missing ones are zeros.
    """

    def __init__(self, batch: Batch, scenarios: Sequence[Scenario]) -> None:
        if batch.action_shape[1] != batch.scenario.num_trackers:
            raise ValueError(f"see_state needs all trackers moved from outside, here {batch.action_shape[1]} are")
        self._batch = batch
        self._obstacles_at = TARGET_SIZE + TRACKER_SIZE * max(scenario.num_trackers for scenario in scenarios)
        self.size = self._obstacles_at + OBSTACLE_SIZE * max(scenario.num_obstacles for scenario in scenarios)
        """Numbers in a state."""

    def read(self, worlds: Any = ...) -> FloatArray:
        """Return the state of each world, or of some, for each of its trackers, (trackers of these worlds, size)."""
        s, arrays = self._batch.scenario, self._batch.arrays
        w, tracker, disc = arrays.world[worlds][:, None, None], arrays.tracker[worlds], arrays.obstacle[worlds][:, None]
        n, m, at = s.num_trackers, s.num_obstacles, self._obstacles_at
        order = (np.arange(n)[:, None] + np.arange(n)) % n  # of each tracker, itself first
        t = {name: tracker[name][:, order] for name in _READ}  # (E, N, N)

        def framed(x: Any, y: Any) -> tuple[Any, Any]:
            return plain(in_frame)(x, y, w["frame_cos"], w["frame_sin"])  # type: ignore[no-any-return]

        left = (s.horizon - w["step"]).astype(np.float32) * np.float32(s.control_step)  # s
        target = w["speed"], w["turn_rate"], *framed(w["heading_cos"], w["heading_sin"]), w["score"], left
        place, heading = framed(t["x"] - w["x"], t["y"] - w["y"]), framed(t["heading_cos"], t["heading_sin"])
        flags = t["broken_at"] == NEVER, t["slot"] >= 0, t["slot_distance"], t["sees"], t["touching"]
        trackers = *place, *heading, t["speed"], t["turn_rate"], *flags
        obstacles = *framed(disc["x"] - w["x"], disc["y"] - w["y"]), disc["radius"]
        rows, size = np.zeros((len(w), n, self.size), np.float32), n * TRACKER_SIZE
        rows[..., :TARGET_SIZE] = np.concatenate(target, axis=-1)
        rows[..., TARGET_SIZE : TARGET_SIZE + size] = np.stack(trackers, -1).reshape(len(w), n, size)
        rows[..., at : at + m * OBSTACLE_SIZE] = np.stack(obstacles, -1).reshape(len(w), 1, m * OBSTACLE_SIZE)
        return rows.reshape(-1, self.size)
