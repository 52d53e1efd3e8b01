"""Films: policies side by side on the same world, as GIF or MP4."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from posse import Batch, Scenario, get_scenario
from posse.numeric import FloatArray
from posse.rendering.camera import Camera
from posse.rendering.canvas import Canvas, pixels
from posse.rendering.content.history import History
from posse.rendering.content.scene import Scene, read_scene
from posse.rendering.picture import Box, action_of, draw_picture, viewport_of
from posse.rendering.renderer import LEAST_SIZE
from posse.rendering.style import DESIGN_SIZE, GRID
from posse_baselines.playing import check_moves_all
from posse_baselines.policy import Annotations, Memory, Policy, begin
from posse_training.errors import SettingsError
from posse_training.reports.pictures.gif import Frame, write_gif
from posse_training.reports.pictures.mp4 import check_mp4, write_mp4

FORMATS: Final = (".gif", ".mp4")
LARGEST: Final = 4096
"""Greatest width and height of a film, px."""
_MOST_BYTES: Final = 2 << 30  # of the frames of a GIF, which are all in memory at once
_SEAM: Final = 2  # px between panels


def film(
    policies: Sequence[tuple[str, Policy]],
    scenario: str | Scenario,
    *,
    path: str | Path,
    seed: int = 0,
    world: int = 0,
    split: str = "test",
    start: float = 0.0,
    seconds: float = 25.0,
    speed: float = 1.5,
    every: int = 1,
    size: int | tuple[int, int] | None = None,
    **overrides: Any,
) -> Path:
    """Film one world, played by each policy, and write it as an animated GIF or as MP4.

    One camera serves all panels, and keeps every team and target in view. The film says at what
    speed it runs.

    Args:
        policies: (label, policy) of each panel, left to right; the label is its title.
        scenario: A scenario or its name; its messages are made as long as each policy needs.
        path: File to write, ending in ``.gif`` or ``.mp4`` (which needs the extra ``video``);
            folders are created, an old file is replaced.
        seed: Seed of the world.
        world: Index of the world.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        start: Simulated time at which the film begins, s; the episode is played from 0.
        seconds: Simulated time to film, s; less if every episode ends before.
        speed: Simulated seconds per second of film; rounded in a GIF, which counts in 1/100 s.
        every: Control steps between two frames.
        size: Side of a panel, or width and height of the whole film, px; default: panels of 560
            for one, 400 for more.
        **overrides: Settings of the scenario.

    Returns:
        The path.

    Raises:
        SettingsError: No policies, a path of another format, a number out of range, an episode that
            ends before ``start``.
        PolicyError: A policy that does not fit the scenario.
        MissingExtraError: An MP4 without the extra ``video``.
    """
    path = Path(path)
    _check(policies, path, start, seconds, speed, every)
    settings = get_scenario(scenario, **overrides)
    for _, policy in policies:
        check_moves_all(policy, settings)
    dt = settings.control_step
    first = round(start / dt)
    if first >= settings.horizon:
        raise SettingsError(
            f"start={start!r} (--from) must be below {settings.duration:g} s, the duration of {settings.name!r}"
        )
    boxes = _boxes(size, len(policies))
    last = min(settings.horizon, first + max(1, round(seconds / dt)))
    panels = [
        _Panel.begin(label, policy, settings, box, seed, world, split)
        for (label, policy), box in zip(policies, boxes, strict=True)
    ]
    if path.suffix.lower() == ".mp4":
        check_mp4()
    frames = _frames(panels, first, last, every, f"{speed:g}× speed")
    try:
        opening = next(frames)
    except StopIteration:
        raise SettingsError(f"start={start!r} (--from) lies behind the end of every episode: start earlier") from None
    path.parent.mkdir(parents=True, exist_ok=True)
    frame_time = every * dt / speed
    if path.suffix.lower() == ".mp4":
        write_mp4(path, itertools.chain([opening], frames), frame_time)
        return path
    if opening.nbytes * ((last - first) // every + 2) > _MOST_BYTES:
        raise SettingsError(
            f"a GIF of {(last - first) * dt:g} s at {opening.shape[1]} x {opening.shape[0]} px is "
            "too large: make it shorter (--seconds) or smaller (--size), or write an .mp4"
        )
    write_gif(path, [opening, *frames], frame_time)
    return path


@dataclass
class _Panel:
    """One team, as it plays."""

    label: str
    policy: Policy
    batch: Batch
    box: Box
    history: History
    memory: Memory
    observations: FloatArray
    annotations: Annotations
    scene: Scene | None = None

    @classmethod
    def begin(
        cls, label: str, policy: Policy, scenario: Scenario, box: Box, seed: int, world: int, split: str
    ) -> _Panel:
        """Return a panel at the start of the episode."""
        settings = scenario.replace(message_size=max(scenario.message_size, policy.message_size))
        batch = Batch(settings, 1, seed=seed, split=split, first_world=world, autoreset="disabled")
        memory = begin(policy, batch)
        return cls(label, policy, batch, box, History(), memory, batch.reset(), {})

    @property
    def over(self) -> bool:
        return bool(self.batch.worlds["over"][0])

    def play(self, *, last: bool) -> None:
        """Note the present, with the annotations of the decision on it; then step."""
        actions = None
        if not self.over and not last:
            actions, self.memory = self.policy.act(self.observations, self.memory)
            self.annotations = self.policy.annotations(self.memory)
        self.scene = read_scene(self.batch, 0, self.annotations)
        self.history.note(self.scene)
        if actions is not None:
            self.observations, *_ = self.batch.step(actions)


def _frames(panels: Sequence[_Panel], first: int, last: int, every: int, remark: str) -> Iterator[Frame]:
    """Play all panels in step; yield one frame in ``every`` from a step on, and the last one.

    A team whose episode has ended stays as it was.
    """
    lefts = [panel.box[0] + panel.box[2] for panel in panels]
    canvas = Canvas((lefts[-1], panels[0].box[3]))
    point = min(panels[0].box[2:]) / DESIGN_SIZE
    scenario = panels[0].batch.scenario
    cameras = [Camera(viewport_of(p.box, point), scenario.arena, whole=False) for p in panels]
    lead = Camera(cameras[0].viewport, scenario.arena, whole=False)
    for step in range(last + 1):
        ended = all(panel.over for panel in panels) or step == last
        for panel in panels:
            panel.play(last=step == last)
        scenes = [panel.scene for panel in panels if panel.scene is not None]
        lead.follow(np.vstack([action_of(scene) for scene in scenes]), scenario.control_step)
        if step >= first and (ended or (step - first) % every == 0):
            canvas.fill(GRID)
            for panel, camera, scene in zip(panels, cameras, scenes, strict=True):
                camera.look(lead.centre, lead.scale)
                draw_picture(canvas, panel.box, camera, scene, panel.history, point, panel.label, remark)
            yield pixels(canvas.finish())
        if ended:
            return


def _boxes(size: int | tuple[int, int] | None, count: int) -> list[Box]:
    """Return the panels' boxes, left to right."""
    if size is None:
        size = 560 if count == 1 else 400
    given = (size, size) if isinstance(size, int) else tuple(size)
    if len(given) != 2 or any(int(v) != v for v in given):
        raise SettingsError(f"size={size!r} must be a side, or width and height, whole px")
    width, height = (int(v) for v in given)
    if not isinstance(size, int):
        width = (width - _SEAM * (count - 1)) // count
    if min(width, height) < LEAST_SIZE:
        raise SettingsError(f"size={size!r} must be at least {LEAST_SIZE} px, in width for each of {count} policies")
    if max(height, count * (width + _SEAM)) > LARGEST:
        raise SettingsError(f"size={size!r} makes a film of more than {LARGEST} px: lower it")
    return [(k * (width + _SEAM), 0, width, height) for k in range(count)]


def _check(
    policies: Sequence[tuple[str, Policy]], path: Path, start: float, seconds: float, speed: float, every: int
) -> None:
    if not policies:
        raise SettingsError("No policies given. Pass at least one (label, policy).")
    if path.suffix.lower() not in FORMATS:
        raise SettingsError(f"path={str(path)!r} must end in {' or '.join(FORMATS)}: no other format is written")
    for name, value in (("seconds", seconds), ("speed", speed)):
        if not (math.isfinite(value) and value > 0):
            raise SettingsError(f"{name}={value!r} must be a finite number above 0")
    if not (math.isfinite(start) and start >= 0):
        raise SettingsError(f"start={start!r} (--from) must be a finite number, at least 0")
    if every != int(every) or every < 1:
        raise SettingsError(f"every={every!r} must be a whole number of control steps, at least 1")
