"""Moving pictures: policies side by side on the same world, as a GIF."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from PIL import Image

from posse import Batch, Scenario, get_scenario
from posse.rendering.renderer import LEAST_SIZE, Renderer
from posse.rendering.style import GRID, PALETTE
from posse_baselines.policy import Policy, PolicyError, begin
from posse_training.runs.settings import SettingsError

Frame = npt.NDArray[np.uint8]

_BLENDS: Final = 40  # colours for what fades and for anti-aliased edges
_TRANSPARENT: Final = 255
_SAMPLED: Final = 12  # frames that the palette is made from
_SEAM: Final = 2  # px between panels
_LAST_SHOWN: Final = 1.5  # s, before the film starts over


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
        policies: (label, policy) of each panel, left to right; the label stands above it.
        scenario: By name or as a value; its messages are made as long as each policy needs.
        path: Where to write, ending in ``.gif``; folders are made, a file there is replaced.
        seed: Of the world.
        world: Its index.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        seconds: Simulated time to film at most, s; less where every episode ends before.
        speed: Simulated seconds in a second of the film; rounded, since a GIF counts in 1/100 s.
        every: Control steps between two frames.
        size: Side of a panel, px; default: 560 for one, 400 for more.
        **overrides: Settings of the scenario.

    Returns:
        The path.

    Raises:
        SettingsError: No policy, a path that does not end in ``.gif``, a number out of its range.
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
    """Play an episode; yield every so-manieth frame, the first and the last among them."""
    memory = begin(policy, batch)
    observations = batch.reset()
    for step in range(steps + 1):
        over = bool(batch.worlds["over"][0]) or step == steps
        # What the trackers have in mind when they chose this step's actions.
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
    """Join the panels' frames; one that has ended goes on showing its last."""
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


def write_gif(path: Path, frames: Sequence[Frame], frame_time: float) -> None:
    """Write frames (H, W, 3) as a GIF that repeats for ever, ``frame_time`` s each.

    All frames share one palette and are not dithered, so that flat colours stay flat; what a frame
    shares with the one before is left transparent, and costs next to nothing.
    """
    palette = _Palette(frames)
    images: list[Image.Image] = []
    before: Frame | None = None
    for frame in frames:
        indices = palette.indices(frame)
        changed = indices if before is None else np.where(indices == before, _TRANSPARENT, indices)
        before = indices
        image = Image.fromarray(changed.astype(np.uint8))
        image.putpalette(palette.entries.tobytes())
        images.append(image)
    # In 1/1000 s; a GIF counts in 1/100, and players slow down what is faster than two of them.
    shown_for = max(2, round(frame_time * 100)) * 10
    times = [shown_for] * len(images)
    times[-1] = max(shown_for, round(_LAST_SHOWN * 1000))
    images[0].save(
        path,
        save_all=True,
        append_images=images[1:],
        duration=times,
        loop=0,
        disposal=1,  # each frame is laid over the one before
        transparency=_TRANSPARENT,
        optimize=False,
    )


class _Palette:
    """The colours of all frames of a film: at most 255, since one index stands for transparent.

    The flat colours of which a picture is composed are among them as they are, however small their
    areas; the blends between them share what is left.

    Attributes:
        entries: (K, 3) red, green, blue.
    """

    def __init__(self, frames: Sequence[Frame]) -> None:
        chosen = np.unique(np.linspace(0, len(frames) - 1, _SAMPLED).round().astype(int))
        codes, counts = np.unique([_codes(frames[k]) for k in chosen], return_counts=True)
        # By the logarithm of its area: the rim of a robot matters as much as that of an arena.
        blends = _colours(np.repeat(codes, np.log2(counts).astype(int) + 1))
        image = Image.fromarray(blends[None]).quantize(_BLENDS, method=Image.Quantize.MEDIANCUT)
        shared = np.reshape(image.getpalette() or [], (-1, 3))[:_BLENDS]
        self.entries = np.concatenate([np.array(PALETTE), shared]).astype(np.uint8)
        self._index = np.full(1 << 24, _TRANSPARENT, np.uint8)  # by code, as far as met

    def indices(self, frame: Frame) -> Frame:
        """Return the (H, W) indices of the entries nearest to a frame's colours."""
        codes = _codes(frame)
        found = self._index[codes]
        new = np.unique(codes[found == _TRANSPARENT])
        if len(new):
            apart = _colours(new)[:, None].astype(np.int32) - self.entries
            self._index[new] = (apart**2).sum(axis=-1).argmin(axis=-1)
            found = self._index[codes]
        return found


def _codes(frame: Frame) -> npt.NDArray[np.int32]:
    """Return the (H, W) colours of a frame as 0xRRGGBB."""
    codes: npt.NDArray[np.int32] = frame.astype(np.int32) @ np.array([1 << 16, 1 << 8, 1], np.int32)
    return codes


def _colours(codes: npt.NDArray[np.int32]) -> Frame:
    """Return (..., 3) red, green, blue of colours coded as 0xRRGGBB."""
    return np.stack([codes >> 16, (codes >> 8) & 255, codes & 255], axis=-1).astype(np.uint8)


def _check(
    policies: Sequence[tuple[str, Policy]],
    path: Path,
    seconds: float,
    speed: float,
    every: int,
    size: int | None,
) -> None:
    if not policies:
        raise SettingsError("nothing to film: give at least one (label, policy)")
    if path.suffix.lower() != ".gif":
        raise SettingsError(f"path={str(path)!r} must end in .gif: no other format is written")
    for name, value in (("seconds", seconds), ("speed", speed)):
        if not (np.isfinite(value) and value > 0):
            raise SettingsError(f"{name}={value!r} must be a finite number above 0")
    if every != int(every) or every < 1:
        raise SettingsError(f"every={every!r} must be a whole number of control steps, at least 1")
    if size is not None and size < LEAST_SIZE:
        raise SettingsError(f"size={size!r} must be at least {LEAST_SIZE} px")
