"""An estimate of the memory that a training run needs."""

from __future__ import annotations

import itertools
import os
from typing import Final

from posse import ObservationLayout
from posse_baselines.learned import Encoding
from posse_training.errors import SettingsError
from posse_training.runs.settings import TrainSettings

_FLOAT: Final = 4  # bytes
_OWN: Final = 16  # numbers beside the inputs in a row of a buffer: action, reward, value, ...
_COPIES: Final = 8  # of each weight: two networks, gradients, Adam's two moments, copies for saving


def memory_needed(s: TrainSettings) -> int:
    """Return a lower estimate of the memory of a run, in bytes: buffers, inputs, networks."""
    scenarios = s.scenarios
    trackers = max(scenario.num_trackers for scenario in scenarios)
    layout = ObservationLayout(max(scenarios, key=lambda scenario: scenario.num_trackers))
    inputs = Encoding.of(layout, s.encoding, s.num_neighbours).size
    each = min(scenario.num_trackers for scenario in scenarios) if s.side == "trackers" else 1
    slots = s.num_worlds * each
    rows = slots * s.rollout * (inputs + _OWN) if s.on_policy else s.replay * 2 * (inputs + _OWN)
    widths = (inputs, *s.hidden, 2 + s.message_size)
    weights = sum(a * b for a, b in itertools.pairwise(widths))
    worlds = s.num_worlds * trackers * 2 * layout.size
    return _FLOAT * (rows + _COPIES * weights + worlds)


def check_memory(settings: TrainSettings) -> None:
    """Raise if a run needs more memory than the machine has.

    Raises:
        SettingsError: The message names the settings that the memory depends on.
    """
    needed, there = memory_needed(settings), machine_memory()
    if there is not None and needed > there:
        names = "num_worlds, rollout" if settings.on_policy else "num_worlds, replay"
        raise SettingsError(
            f"this training needs at least {needed / 1e9:,.0f} GB of memory, the machine has "
            f"{there / 1e9:,.0f} GB: reduce {names} or hidden"
        )


def machine_memory() -> int | None:
    """Return the physical memory of the machine in bytes; ``None``: unknown."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return None
