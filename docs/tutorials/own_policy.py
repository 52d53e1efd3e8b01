"""A custom policy: every tracker heads for the slot of its own number.

Compare it with others:     python docs/tutorials/own_policy.py
Or in a comparison:         cd docs/tutorials && posse compare pursuit own_policy:OwnSlot
"""

import argparse
from typing import Any

import numpy as np

from posse import ObservationLayout
from posse_baselines import BasePolicy, load
from posse_training import evaluate


class OwnSlot(BasePolicy):
    """Every tracker goes to the slot of its own number and ignores the others."""

    name = "own-slot"

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Any:
        """Return the memory: what stays the same for a whole episode."""
        super().begin(layout, num_worlds)  # checks the message size
        return layout, np.array(layout.scenario.slot_offsets)

    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        """Return actions (E, N, 2 + m) for observations (E, N, F), and the memory."""
        layout, slots = memory  # slots (N, 2): ahead and to the left of the target, m
        seen = layout.views(observations)  # every field by name, (E, N) or (E, N, size)

        # In the robot's frame: the target's last fix and the slot frame at that time.
        target = seen["target_range"][..., None] * seen["target_bearing"]
        cos, sin = seen["target_frame"][..., 0], seen["target_frame"][..., 1]
        ahead = target[..., 0] + slots[:, 0] * cos - slots[:, 1] * sin
        left = target[..., 1] + slots[:, 0] * sin + slots[:, 1] * cos

        # Turn towards the slot; the speed follows the component of the distance ahead.
        bearing, distance = np.arctan2(left, ahead), np.hypot(ahead, left)
        forward = np.clip(2 * distance, 0, 1) * np.maximum(np.cos(bearing), 0)
        turn = np.clip(2 * bearing, -1, 1) * np.minimum(4 * distance, 1)

        # Until the target is known, move in a circle to search for it.
        known = seen["target_known"] > 0
        actions = np.zeros((*known.shape, 2 + layout.scenario.message_size), np.float32)
        actions[..., 0] = np.where(known, 2 * forward - 1, 0)  # -1: at rest, 1: full speed
        actions[..., 1] = np.where(known, turn, 0.3)
        return actions, memory


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--episodes", type=int, default=200)
    arguments = parser.parse_args()
    for policy in (load("pursuit"), OwnSlot(), load("ddcs-distributed")):
        results = evaluate(policy, "constant", episodes=arguments.episodes, progress=False)
        print(f"{policy.name:18s} score {results.estimate('score')}")
