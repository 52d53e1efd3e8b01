"""A custom policy: every tracker heads for the slot of its own number.

python docs/tutorials/own_policy.py
cd docs/tutorials && posse compare pursuit own_policy:OwnSlot
"""

import argparse
from typing import Any

import numpy as np

from posse import ObservationLayout
from posse_baselines import BasePolicy, load
from posse_training import evaluate


class OwnSlot(BasePolicy):
    """Every tracker goes to its own slot and ignores the others."""

    name = "own-slot"

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Any:
        """Return the memory: what stays the same for an episode."""
        super().begin(layout, num_worlds)  # checks the message size
        return layout, np.array(layout.scenario.slot_offsets)

    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        """Return actions (E, N, 2 + m), and the memory."""
        # Slots (N, 2): ahead and to the left of the target, m.
        layout, slots = memory
        # Every field by name, (E, N) or (E, N, size).
        seen = layout.views(observations)

        # In the robot's frame: the target's last fix, and the slot
        # frame at that time.
        target = (
            seen["target_range"][..., None] * seen["target_bearing"]
        )
        frame = seen["target_frame"]
        cos, sin = frame[..., 0], frame[..., 1]
        ahead = target[..., 0] + slots[:, 0] * cos - slots[:, 1] * sin
        left = target[..., 1] + slots[:, 0] * sin + slots[:, 1] * cos

        # Turn towards the slot; the speed follows the component of the
        # distance ahead.
        bearing = np.arctan2(left, ahead)
        distance = np.hypot(ahead, left)
        forward = np.clip(2 * distance, 0, 1)
        forward *= np.maximum(np.cos(bearing), 0)
        turn = np.clip(2 * bearing, -1, 1) * np.minimum(4 * distance, 1)

        # Until the target is known, move in a circle to search for it.
        # A speed of -1 is at rest, 1 full speed.
        known = seen["target_known"] > 0
        size = 2 + layout.scenario.message_size
        actions = np.zeros((*known.shape, size), np.float32)
        actions[..., 0] = np.where(known, 2 * forward - 1, 0)
        actions[..., 1] = np.where(known, turn, 0.3)
        return actions, memory


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--episodes", type=int, default=200)
    settings = {**vars(parser.parse_args()), "progress": False}
    teams = load("pursuit"), OwnSlot(), load("ddcs-distributed")
    for policy in teams:
        results = evaluate(policy, "constant", **settings)
        print(f"{policy.name:18s} score {results.estimate('score')}")
