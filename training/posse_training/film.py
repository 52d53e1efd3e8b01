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
from posse.render import LEAST_SIZE, Renderer
from posse_baselines.policy import Policy, PolicyError, begin

Frame = npt.NDArray[np.uint8]

_COLOURS: Final = 128
_SAMPLED: Final = 12  # frames that the palette is made from
_SEAM: Final = 2  # px between panels
_SEAM_GREY: Final = 205
_LAST_SHOWN: Final = 1.5  # s, before the film starts over


def film(
    policies: Sequence[tuple[str, Policy]],
    scenario: str | Scenario,
    *,
    path: str | Path,
    seed: int = 0,
    world: int = 0,
    split: str = "test",
    seconds: float = 30.0,
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
        size: Side of a panel, px; default: 560 for one, 420 for more.
        **overrides: Settings of the scenario.

    Returns:
        The path.

    Raises:
        ValueError: No policy, a path that does not end in ``.gif``, or a number out of its range.
        PolicyError: A policy that does not fit the scenario.
    """
    path = Path(path)
    _check(policies, path, seconds, speed, every, size)
    world_of = get_scenario(scenario, **overrides)
    if world_of.num_agents != world_of.num_trackers:
        raise PolicyError(
            f"the target of {world_of.name!r} is an agent, and a policy drives trackers only"
        )
    side = size or (560 if len(policies) == 1 else 420)
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
        last = [frame if frame is not None else old for frame, old in zip(frames, last, strict=True)]
        strip: list[Frame] = []
        for frame in last:
            assert frame is not None
            seam = np.full((frame.shape[0], _SEAM, 3), _SEAM_GREY, np.uint8)
            strip += [seam, frame] if strip else [frame]
        yield np.concatenate(strip, axis=1)


def write_gif(path: Path, frames: Sequence[Frame], frame_time: float) -> None:
    """Write frames (H, W, 3) as a GIF that repeats for ever, ``frame_time`` s each.

    All frames share one palette and are not dithered: flat colours stay flat, and what does not
    change between two frames costs nothing.
    """
    palette = _palette(frames)
    images = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames
    ]
    shown = max(2, round(frame_time * 100)) * 10  # ms; players slow down what is faster than 2/100 s
    times = [shown] * len(images)
    times[-1] = max(shown, round(_LAST_SHOWN * 1000))
    # optimize=False: the palette is right as it is; to look for a smaller one takes 20 ms a frame.
    images[0].save(
        path,
        save_all=True,
        append_images=images[1:],
        duration=times,
        loop=0,
        disposal=1,
        optimize=False,
    )


def _palette(frames: Sequence[Frame]) -> Image.Image:
    """Return an image that carries the palette of all frames.

    A colour weighs by the logarithm of its area: the few pixels of a robot matter as much as the
    wide ground.
    """
    chosen = np.unique(np.linspace(0, len(frames) - 1, _SAMPLED).round().astype(int))
    pixels = np.concatenate([frames[k].reshape(-1, 3) for k in chosen]).astype(np.int32)
    codes, counts = np.unique(pixels @ (65536, 256, 1), return_counts=True)
    often = counts >= len(chosen)  # colours of single pixels are not worth an entry
    codes, counts = codes[often], counts[often]
    weighted = np.repeat(codes, np.log2(counts).astype(int) + 1)
    colours = np.stack([weighted >> 16, (weighted >> 8) & 255, weighted & 255], -1)
    image = Image.fromarray(colours.astype(np.uint8)[None])
    return image.quantize(_COLOURS, method=Image.Quantize.MEDIANCUT)


def _check(
    policies: Sequence[tuple[str, Policy]],
    path: Path,
    seconds: float,
    speed: float,
    every: int,
    size: int | None,
) -> None:
    if not policies:
        raise ValueError("nothing to film: give at least one (label, policy)")
    if path.suffix.lower() != ".gif":
        raise ValueError(f"path={str(path)!r} must end in .gif: no other format is written")
    for name, value in (("seconds", seconds), ("speed", speed)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name}={value!r} must be a finite number above 0")
    if not isinstance(every, int) or every < 1:
        raise ValueError(f"every={every!r} must be a whole number of control steps, at least 1")
    if size is not None and size < LEAST_SIZE:
        raise ValueError(f"size={size!r} must be at least {LEAST_SIZE} px")
