"""Films: policies side by side on the same world, as a GIF."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from posse import Batch, Scenario, get_scenario
from posse.rendering.renderer import LEAST_SIZE, Renderer
from posse.rendering.style import GRID
from posse_baselines.policy import Policy, PolicyError, begin
from posse_training.errors import SettingsError
from posse_training.reports.pictures.gif import Frame, write_gif

_SEAM: Final = 2  # px between panels


def film(
    policies: Sequence[tuple[str, Policy]],
    scenario: str | Scenario,
    *,
    path: str | Path,
    seed: int = 0,
    world: int = 0,
    split: str = "test",
    seconds: float = 25.0,
    speed: float = 1.5,
    every: int = 1,
    size: int | None = None,
    **overrides: Any,
) -> Path:
    """Film one world, played by each policy, and write it as an animated GIF.

    Args:
        policies: (label, policy) of each panel, left to right; the label is its title.
        scenario: A scenario or its name; its messages are made as long as each policy needs.
        path: File to write, ending in ``.gif``; folders are created, an old file is replaced.
        seed: Seed of the world.
        world: Index of the world.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        seconds: Simulated time to film, s; less if every episode ends before.
        speed: Simulated seconds per second of film; rounded, since a GIF counts in 1/100 s.
        every: Control steps between two frames.
        size: Side of a panel, px; default: 560 for one, 400 for more.
        **overrides: Settings of the scenario.

    Returns:
        The path.

    Raises:
        SettingsError: No policies, a path that does not end in ``.gif``, a number out of range.
        PolicyError: A policy that does not fit the scenario.
    """
    path = Path(path)
    _check(policies, path, seconds, speed, every, size)
    world_of = get_scenario(scenario, **overrides)
    if world_of.num_agents != world_of.num_trackers:
        raise PolicyError(
            f"the target of {world_of.name!r} is an agent, and a policy drives trackers only"
        )
    side = size or (560 if len(policies) == 1 else 400)
    steps = min(world_of.horizon, round(seconds / world_of.control_step))
    panels = []
    for label, policy in policies:
        settings = world_of.replace(message_size=max(world_of.message_size, policy.message_size))
        batch = Batch(
            settings, 1, seed=seed, split=split, first_world=world, autoreset="disabled"
        )  # fmt: skip
        renderer = Renderer(settings, size=(side, side), title=label)
        panels.append(_panel(batch, policy, renderer, steps, every))
    frames = list(_side_by_side(panels))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_gif(path, frames, every * world_of.control_step / speed)
    return path


def _panel(
    batch: Batch, policy: Policy, renderer: Renderer, steps: int, every: int
) -> Iterator[Frame]:
    """Play an episode; yield one frame in ``every``, including the first and the last."""
    memory = begin(policy, batch)
    observations = batch.reset()
    for step in range(steps + 1):
        over = bool(batch.worlds["over"][0]) or step == steps
        # The annotations are those of the decision on this step's actions.
        if not over:
            actions, memory = policy.act(observations, memory)
        if over or step % every == 0:
            frame = renderer.draw(batch, annotations=policy.annotations(memory))
            assert frame is not None
            yield frame
        else:
            renderer.follow(batch)
        if over:
            return
        observations, *_ = batch.step(actions)


def _side_by_side(panels: Sequence[Iterator[Frame]]) -> Iterator[Frame]:
    """Join the panels' frames; a panel that has ended repeats its last frame."""
    last: list[Frame | None] = [None] * len(panels)
    for frames in itertools.zip_longest(*panels):
        last = [
            frame if frame is not None else old for frame, old in zip(frames, last, strict=True)
        ]
        strip: list[Frame] = []
        for frame in last:
            assert frame is not None
            seam = np.full((frame.shape[0], _SEAM, 3), GRID, np.uint8)
            strip += [seam, frame] if strip else [frame]
        yield np.concatenate(strip, axis=1)


def _check(
    policies: Sequence[tuple[str, Policy]],
    path: Path,
    seconds: float,
    speed: float,
    every: int,
    size: int | None,
) -> None:
    if not policies:
        raise SettingsError("No policies given. Pass at least one (label, policy).")
    if path.suffix.lower() != ".gif":
        raise SettingsError(f"path={str(path)!r} must end in .gif: no other format is written")
    for name, value in (("seconds", seconds), ("speed", speed)):
        if not (np.isfinite(value) and value > 0):
            raise SettingsError(f"{name}={value!r} must be a finite number above 0")
    if every != int(every) or every < 1:
        raise SettingsError(f"every={every!r} must be a whole number of control steps, at least 1")
    if size is not None and size < LEAST_SIZE:
        raise SettingsError(f"size={size!r} must be at least {LEAST_SIZE} px")
