"""The contents of one frame, read from a batch; drawing does not access records."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium.error import ResetNeeded

from posse.numeric import BoolArray
from posse.rendering.content.knowledge import Knowledge, read_knowledge
from posse.rules.state import NEVER
from posse.scenarios import Scenario
from posse.scenarios.formation import slot_offsets

if TYPE_CHECKING:
    from posse.engine.batch import Batch

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_LINK_FADES: Final = 6
"""Control steps after which a silent link is no longer drawn."""
_ANNOTATIONS: Final = ("task", "leader")


@dataclass(frozen=True)
class Scene:
    """One world at one time. N trackers, M obstacles; metres, seconds, radians."""

    scenario: Scenario
    episode: tuple[int, ...]
    """Identifies world and episode."""
    step: int
    score: float
    """Mean over the steps so far."""
    position: Floats
    """(N, 2)."""
    heading: Floats
    """(N, 2), cosine and sine."""
    broken: BoolArray
    """(N,)."""
    sees: BoolArray
    """(N,) the tracker's own sensor sees the target."""
    senses: BoolArray
    """(N,) the target sensor works."""
    struck: BoolArray
    """(N,) a contact began in this step."""
    target: Floats
    """(2,)."""
    target_heading: Floats
    """(2,), cosine and sine."""
    frame: Floats
    """(2,), cosine and sine of the slot frame's heading ψ."""
    slots: Floats
    """(N, 2) positions of the slots."""
    occupied: BoolArray
    """(N,) by slot."""
    obstacles: Floats
    """(M, 3): x, y, radius."""
    links: Floats
    """(N, N) symmetric, in [0, 1]: 1 where one was heard by the other in this step, fading with
    the steps since; all 0 where the radio is perfect."""
    task: Integers | None
    """(N,) number of each tracker's task in :data:`posse.rendering.style.TASKS`, -1: none."""
    leads: BoolArray | None
    """(N,) the tracker considers itself the leader; ``None``: the team has no leader."""
    knowledge: Knowledge

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return self.step * self.scenario.control_step

    @property
    def limited_sight(self) -> bool:
        """Whether a tracker may fail to see the target."""
        s = self.scenario
        return (
            math.isfinite(s.sensing_range)
            or s.field_of_view < 2 * math.pi - 1e-9
            or s.num_obstacles > 0
            or s.sensor_outages > 0
        )


def read_scene(
    batch: Batch,
    world: int = 0,
    annotations: Mapping[str, npt.ArrayLike] | None = None,
    observations: npt.NDArray[Any] | None = None,
) -> Scene:
    """Return the scene of one world of a batch.

    Args:
        batch: A batch that has been reset.
        world: Its index in the batch.
        annotations: Internal values of a policy, (E, N) integers each: ``"task"``, and
            ``"leader"``, the number of each tracker's leader (-1: none); what
            :func:`posse.rendering.content.knowledge.read_knowledge` reads. Other names are ignored.
        observations: (E, rows, F) of the present state, for the sonar.

    Raises:
        ValueError: No such world, or annotations of a wrong shape.
        ResetNeeded: The batch has not been reset.
    """
    scenario, state = batch.scenario, batch.state
    num_worlds = len(state["world_step"])
    if not 0 <= world < num_worlds:
        raise ValueError(f"world={world} is not in the batch: it holds worlds 0 to {num_worlds - 1}")
    of = {name: array[world] for name, array in state.items()}
    if of["world_heading_cos"] == 0 and of["world_heading_sin"] == 0:
        raise ResetNeeded("nothing to draw before reset: call reset() first")
    step = int(of["world_step"])
    told = _check_annotations(annotations, (num_worlds, scenario.num_trackers))
    target, frame = _pair(of, "world", "x", "y"), _pair(of, "world", "frame_cos", "frame_sin")
    offsets = np.array(slot_offsets(scenario))
    cosine, sine = frame
    occupied = np.zeros(scenario.num_trackers, np.bool_)
    occupied[of["tracker_slot"][of["tracker_slot"] >= 0]] = True
    dead_from = of["tracker_sensor_dead_from"].astype(np.int64)
    outage = max(1, round(scenario.outage_time / scenario.control_step))
    broken = of["tracker_broken_at"] != NEVER
    leads = None
    if "leader" in told:
        leads = (told["leader"][world] == np.arange(scenario.num_trackers)) & ~broken
    return Scene(
        scenario=scenario,
        episode=tuple(int(of[f"world_{k}"]) for k in ("seed", "split", "index", "episode", "key")),
        step=step,
        score=float(of["world_score_sum"]) / max(step, 1),
        position=_pair(of, "tracker", "x", "y"),
        heading=_pair(of, "tracker", "heading_cos", "heading_sin"),
        broken=broken,
        sees=of["tracker_sees"] != 0,
        senses=~broken & ((step < dead_from) | (step >= dead_from + outage)),
        struck=of["tracker_onsets"] > 0,
        target=target,
        target_heading=_pair(of, "world", "heading_cos", "heading_sin"),
        frame=frame,
        slots=target + offsets @ np.array([[cosine, sine], [-sine, cosine]]),
        occupied=occupied,
        obstacles=np.stack([of[f"obstacle_{k}"] for k in ("x", "y", "radius")], -1).astype(float),
        links=_links(of["heard_step"], step - scenario.radio_delay, scenario.num_trackers),
        task=told["task"][world] if "task" in told else None,
        leads=leads,
        knowledge=read_knowledge(batch, world, annotations, observations),
    )


def _pair(of: Mapping[str, npt.NDArray[Any]], array: str, first: str, second: str) -> Floats:
    return np.stack([of[f"{array}_{first}"], of[f"{array}_{second}"]], axis=-1).astype(np.float64)


def _links(heard_at: npt.NDArray[Any], now: int, n: int) -> Floats:
    """Return link strengths (N, N) from the steps (N, N) at which the last messages were sent."""
    if heard_at.size == 0 or now < 0:
        return np.zeros((n, n))
    strength = np.where(heard_at >= 0, 1 - (now - heard_at.astype(np.float64)) / _LINK_FADES, 0.0)
    strength = np.clip(strength, 0.0, 1.0)
    np.fill_diagonal(strength, 0.0)
    return np.asarray(np.maximum(strength, strength.T), np.float64)


def _check_annotations(annotations: Mapping[str, npt.ArrayLike] | None, shape: tuple[int, int]) -> dict[str, Integers]:
    told = {}
    for name in _ANNOTATIONS:
        if annotations is None or annotations.get(name) is None:
            continue
        array = np.asarray(annotations[name])
        if array.shape != shape or array.dtype.kind not in "iu":
            raise ValueError(
                f"annotations[{name!r}] is {array.dtype} of shape {array.shape}, "
                f"wanted integers of shape {shape}: (worlds, trackers)"
            )
        told[name] = array.astype(np.int64)
    return told
