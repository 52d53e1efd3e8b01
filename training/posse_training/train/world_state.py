"""The state of a world as a centralized critic reads it, whatever the trackers can observe.

All vectors are in the target's slot frame (ahead, left), so that the state does not depend on the
position in the plane. The tracker whose value is estimated comes first, the others by number.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from posse import Batch, Scenario
from posse.numeric import ONE, ZERO, FloatArray, Records, kernel
from posse.rules import NEVER, config_record, in_frame

TARGET_SIZE: Final = 6
TRACKER_SIZE: Final = 11
OBSTACLE_SIZE: Final = 3


@kernel
def _write(config: Records, world: Records, tracker: Records, obstacle: Records, places: int, out: FloatArray) -> None:
    c = config[0]
    n = c.num_trackers
    for e in range(len(world)):
        w = world[e]
        for i in range(n):
            o = out[e * n + i]
            for k in range(len(o)):
                o[k] = ZERO
            o[0] = w.speed
            o[1] = w.turn_rate
            o[2], o[3] = in_frame(w.heading_cos, w.heading_sin, w.frame_cos, w.frame_sin)
            o[4] = w.score
            o[5] = np.float32(c.horizon - w.step) * c.control_step
            for j in range(n):
                t = tracker[e, (i + j) % n]
                k = TARGET_SIZE + j * TRACKER_SIZE
                o[k], o[k + 1] = in_frame(t.x - w.x, t.y - w.y, w.frame_cos, w.frame_sin)
                o[k + 2], o[k + 3] = in_frame(t.heading_cos, t.heading_sin, w.frame_cos, w.frame_sin)
                o[k + 4] = t.speed
                o[k + 5] = t.turn_rate
                o[k + 6] = ONE if t.broken_at == NEVER else ZERO
                o[k + 7] = ONE if t.slot >= 0 else ZERO
                o[k + 8] = t.slot_distance
                o[k + 9] = np.float32(t.sees)
                o[k + 10] = np.float32(t.touching)
            for m in range(c.num_obstacles):
                k = TARGET_SIZE + places * TRACKER_SIZE + m * OBSTACLE_SIZE
                disc = obstacle[e, m]
                o[k], o[k + 1] = in_frame(disc.x - w.x, disc.y - w.y, w.frame_cos, w.frame_sin)
                o[k + 2] = disc.radius


class StateWriter:
    """Writes the state of a batch's worlds, once for each tracker.

    Args:
        batch: The worlds.
        scenarios: States have places for the most trackers and obstacles that any of these has; missing ones are zeros.

    Raises:
        ValueError: A policy inside the batch moves trackers.
    """

    def __init__(self, batch: Batch, scenarios: Sequence[Scenario]) -> None:
        if batch.action_shape[1] != batch.scenario.num_trackers:
            raise ValueError(f"see_state needs all trackers moved from outside, here {batch.action_shape[1]} are")
        self._batch = batch
        self._config = config_record(batch.scenario)
        self._places = max(scenario.num_trackers for scenario in scenarios)
        obstacles = max(scenario.num_obstacles for scenario in scenarios)
        self.size = TARGET_SIZE + self._places * TRACKER_SIZE + obstacles * OBSTACLE_SIZE
        """Numbers in a state."""

    def write(self, out: FloatArray, worlds: Any = slice(None)) -> None:
        """Write the state of each world, or of some, for each of its trackers.

        ``out`` is (trackers of these worlds, size).
        """
        arrays = self._batch.arrays
        world, tracker, obstacle = (a[worlds] for a in (arrays.world, arrays.tracker, arrays.obstacle))
        _write(self._config, world, tracker, obstacle, self._places, out)
