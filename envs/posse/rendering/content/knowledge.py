"""What each tracker knows of the target and of its team-mates, as a picture shows it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from posse.rules.state import perfect_radio

if TYPE_CHECKING:
    from posse.engine.batch import Batch

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Knowledge:
    """Of N trackers; metres, radians, seconds."""

    fix: Floats
    """(N, 2) the place of the target in the best fix; not a number: none, or a bearing."""
    fix_heading: Floats
    """(N, 2), cosine and sine of the target's heading in it."""
    fix_age: Floats
    """(N,) s; ``inf``: no fix yet."""
    heard_age: Floats
    """(N, N) time since what tracker i last heard of tracker j was sent, s; ``inf``: never."""
    sonar: Floats | None
    """(N, S) range of each beam from the robot's rim, the first ahead; ``None``: not given."""
    estimate: Floats | None
    """(N, 3) x, y, θ where the policy believes the target to be; not a number: nowhere."""
    slot: Integers | None
    """(N,) the slot that the policy sends each tracker to, -1: none."""


def read_knowledge(
    batch: Batch,
    world: int,
    annotations: Mapping[str, npt.ArrayLike] | None = None,
    observations: npt.NDArray[Any] | None = None,
) -> Knowledge:
    """Return what the trackers of one world know.

    Args:
        batch: A batch that has been reset.
        world: Its index in the batch.
        annotations: Internal values of a policy; ``"estimate"`` (E, N, 3), ``"estimate_age"`` and
            ``"slot"`` (E, N) are read, where they have this shape.
        observations: (E, rows, F) of the present state, which hold the sonar.
    """
    scenario, state = batch.scenario, batch.state
    n, dt = scenario.num_trackers, scenario.control_step
    of = {name: array[world] for name, array in state.items()}
    step = int(of["world_step"])
    taken = of["tracker_fix_step"].astype(np.float64)
    known = taken >= 0
    bearing = (of["tracker_fix_cos"] == 0) & (of["tracker_fix_sin"] == 0)
    place = np.stack([of["tracker_fix_x"], of["tracker_fix_y"]], axis=-1).astype(np.float64)
    place[~known | bearing] = math.nan
    heard = np.zeros((n, n))
    if not perfect_radio(scenario):
        sent = of["heard_step"].astype(np.float64)
        heard = np.where(sent >= 0, (step - sent) * dt, math.inf)
    sonar = None
    if observations is not None and scenario.sonar_beams:
        beams = batch.layout.views(observations[world, :n])["sonar"]
        sonar = beams.reshape(n, scenario.sonar_beams).astype(np.float64)
    told = {
        name: np.asarray(value)
        for name, value in (annotations or {}).items()
        if name in ("estimate", "estimate_age", "slot") and value is not None
    }
    shape = (batch.num_worlds, n)
    estimate, slot = told.get("estimate"), told.get("slot")
    if estimate is not None:
        estimate = estimate[world].astype(np.float64) if estimate.shape == (*shape, 3) else None
    age = told.get("estimate_age")
    if estimate is not None and age is not None and age.shape == shape:
        estimate[age[world] < 0] = math.nan
    if slot is not None:
        fits = slot.shape == shape and slot.dtype.kind in "iu"
        slot = slot[world].astype(np.int64) if fits else None
    return Knowledge(
        fix=place,
        fix_heading=np.stack([of["tracker_fix_cos"], of["tracker_fix_sin"]], -1).astype(float),
        fix_age=np.where(known, (step - taken) * dt, math.inf),
        heard_age=heard,
        sonar=sonar,
        estimate=estimate,
        slot=slot,
    )
