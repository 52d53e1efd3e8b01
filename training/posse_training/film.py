"""Films: teams side by side in the same world, as GIF or MP4."""

import io
import itertools
import math
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from posse import Scenario, get_scenario
from posse.rendering import style
from posse.rendering.renderer import LEAST_SIZE, Renderer
from posse_baselines.ddcs import TASKS
from posse_baselines.files import write_atomically
from posse_baselines.playing import batch_for
from posse_baselines.policy import Annotations, Policy, begin
from posse_baselines.registry import Target
from posse_training.errors import SettingsError, require
from posse_training.evaluation.evaluation import played_errors
from posse_training.replay.page import PLAYERS, TASK_COLOURS

_LARGEST: Final = 4096  # px, of width and height
_STRIP: Final = 100  # px, height of the curves of scores in a film of _NARROW px
_NARROW: Final = 640  # px, of width: in a wider film text and curves grow
_LARGER: Final = 1.4  # times the size of text in other frames: films are shown small
_FLAT: Final = [c for c in vars(style).values() if isinstance(c, tuple)] + [*TASK_COLOURS, *PLAYERS]


class Team:
    """A policy as it plays one world against a target, or the scenario's own."""

    def __init__(
        self, policy: Policy, scenario: Scenario, seed: int, world: int, split: str, target: Target | None = None
    ) -> None:
        self.policy = policy
        place: dict[str, Any] = {"seed": seed, "split": split, "first_world": world}
        self.batch = batch_for(policy, scenario, 1, target, **place, autoreset="disabled")
        self.scores: list[float] = []  # of each step
        with played_errors():
            self._memory = begin(policy, self.batch)
        self._observations = self.batch.reset()
        self.told: Annotations = {}

    @property
    def over(self) -> bool:
        """Whether the episode has ended."""
        return bool(self.batch.arrays.world["over"][0])

    @property
    def colours(self) -> list[style.Colour] | None:
        """Colours of the trackers by task; ``None``: the policy tells none."""
        tasks = self.told.get("task")
        return None if tasks is None else [(*TASK_COLOURS, style.TRACKER)[task] for task in tasks[0]]  # -1: none

    def step(self) -> None:
        """Advance by one control step, unless the episode has ended."""
        if not self.over:
            with played_errors():
                actions, self._memory = self.policy.act(self._observations, self._memory)
                self.told = self.policy.annotations(self._memory)
                self._observations, *_, infos = self.batch.step(actions)
            self.scores.append(float(infos["score"][0]))


def film(
    policies: Sequence[tuple[str, Policy]],
    scenario: str | Scenario,
    *,
    path: str | Path,
    target: Target | None = None,
    seed: int = 0,
    world: int = 0,
    split: str = "test",
    start: float = 0.0,
    seconds: float = 25.0,
    speed: float = 1.5,
    every: int = 1,
    size: int | tuple[int, int] | None = None,
    scores: bool = False,
    **overrides: Any,
) -> Path:
    """Film one world, played by each policy, and write it as an animated GIF or as MP4; return the path.

    Args:
        policies: (label, policy) of each panel, left to right; the label is its title.
        scenario: A scenario or its name; its messages are made as long as each policy needs.
        path: File to write, ending in ``.gif`` or ``.mp4`` (which needs the extra ``video``);
            folders are created, an old file is replaced.
        target: Default: the scenario's own motion.
        seed: Seed of the world.
        world: Index of the world.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        start: Simulated time at which the film begins, s; the episode is played from 0.
        seconds: Simulated time to film, s; less if every episode ends before.
        speed: Simulated seconds per second of film; rounded in a GIF, which counts in 1/100 s.
        every: Control steps between two frames; in a GIF at least 2/100 s of film.
        size: Side of a panel, or width and height of all; default: 560 px for one, 400 for more.
        scores: Whether curves of each team's score in the last second stand below.
        **overrides: Settings of the scenario.

    Raises:
        SettingsError: No policies, a path of another format, a number out of range.
        PolicyError: A policy that does not fit the scenario.
        MissingExtraError: An MP4 without the extra ``video``.
        PlayError: A policy that raised, or returned invalid actions.
    """
    path, settings = Path(path), get_scenario(scenario, **overrides)
    if not policies:
        raise SettingsError("No policies given. Pass at least one (label, policy).")
    write = {".gif": _gif, ".mp4": _mp4}.get(path.suffix.lower())
    if write is None:
        raise SettingsError(f"path={str(path)!r} must end in .gif or .mp4: no other format is written")
    if write is _mp4:
        require("video", "imageio_ffmpeg")
    for name, value in (("seconds", seconds), ("speed", speed), ("every", every)):
        if not 0 < value < math.inf or (name == "every" and value != int(value)):
            raise SettingsError(f"{name}={value!r} must be a {'whole' if name == 'every' else 'finite'} number above 0")
    if not 0 <= start < settings.duration:
        raise SettingsError(f"start={start!r} (--from) must be 0 to below {settings.duration:g} s, the duration")
    if write is _gif:  # which shows a frame for 0.02 to 655 s
        every = max(every, math.ceil(0.02 * speed / settings.control_step - 1e-9))
        if every * settings.control_step / speed > 655:
            raise SettingsError(f"speed={speed!r} is too low for a GIF, whose frames are shown for at most 655 s")
    elif speed > 1000 * every * settings.control_step:
        raise SettingsError(f"speed={speed!r} is too high for an MP4, which shows at most 1,000 frames/s")
    given = (560 if len(policies) == 1 else 400) if size is None else size
    width, height = (given, given) if isinstance(given, int) else (given[0] // len(policies), given[1])
    if min(width, height) < LEAST_SIZE or max(width * len(policies), height) > _LARGEST:
        raise SettingsError(f"size={size!r} must be at least {LEAST_SIZE} px a panel, and at most {_LARGEST} in all")
    first, last = (round(time / settings.control_step) for time in (start, min(start + seconds, settings.duration)))
    last = max(last, first + 1)

    teams = [(label, Team(policy, settings, seed, world, split, target)) for label, policy in policies]
    drawn = _frames(teams, (width, height), first, last, every, speed)
    frames = (_with_curves(frame, teams, first, last) if scores else frame for frame in drawn)
    opening = next(frames, None)
    if opening is None:
        raise SettingsError(f"start={start!r} (--from) lies behind the end of every episode: start earlier")
    content = write(itertools.chain([opening], frames), every * settings.control_step / speed)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, content)
    return path


def _frames(
    teams: list[tuple[str, Team]], size: tuple[int, int], first: int, last: int, every: int, speed: float
) -> Iterator[Image.Image]:
    """Play all teams in step; yield one frame in ``every`` from a step on, and the last one.

    All panels have the smallest scale of all. A team whose episode has ended stays as it was.
    """
    shown = [
        (team, Renderer(team.batch.scenario, size=size, title=f"{label}, {speed:g}×", scale=_LARGER))
        for label, team in teams
    ]
    for step in range(last + 1):
        ended = all(team.over for team, _ in shown) or step == last
        for team, renderer in shown:
            renderer.follow(team.batch)
        scale = min(renderer.camera.scale for _, renderer in shown)
        for _, renderer in shown:
            renderer.camera.scale = scale
        if step >= first and (ended or (step - first) % every == 0):
            panels = [renderer.draw(team.batch, colours=team.colours) for team, renderer in shown]
            image = Image.fromarray(np.hstack([panel for panel in panels if panel is not None]))
            point = _LARGER * min(size) / style.DESIGN_SIZE
            for k, (_, colour) in enumerate(zip(panels, itertools.cycle(PLAYERS))):
                if len(panels) > 1:
                    image.paste(colour, (k * size[0], 0, (k + 1) * size[0], round(5 * point)))
                if k:
                    image.paste(style.GRID, (k * size[0] - 1, 0, k * size[0] + 1, size[1]))
            if any(team.colours for team, _ in shown):
                led = any("leader" in team.told for team, _ in shown)
                entries = list(zip(TASKS, TASK_COLOURS, strict=True))[: None if led else -1]
                _write_key(image, entries, size[1] - 15 * point, max(0.6, point))
            yield image
        if ended:
            return
        for team, _ in shown:
            team.step()


def _write_key(image: Image.Image, entries: Sequence[tuple[str, style.Colour]], middle: float, k: float) -> None:
    """Write names with their colours, ending on the right, ``k`` px a point."""
    draw, font, right = ImageDraw.Draw(image), ImageFont.load_default(12 * k), image.width - 14 * k
    for name, colour in reversed(entries):
        draw.text((right, middle), name, style.FAINT_INK, font, anchor="rm")
        right -= draw.textlength(name, font) + 9 * k
        draw.circle((right, middle), 4 * k, colour)
        right -= 16 * k


def _with_curves(image: Image.Image, teams: list[tuple[str, Team]], first: int, last: int) -> Image.Image:
    """Return a frame with each team's score in the last second below, from the film's start to the present."""
    unit, larger = max(1.0, image.width / _NARROW), 3  # drawn larger, then averaged down
    k, height = unit * larger, round(_STRIP * unit)
    strip = Image.new("RGB", (image.width * larger, height * larger), style.PAPER)
    draw, left, right, top, low = ImageDraw.Draw(strip), 30 * k, strip.width - 14 * k, 32 * k, strip.height - 12 * k
    _write_key(strip, [(label, colour) for (label, _), colour in zip(teams, itertools.cycle(PLAYERS))], 14 * k, k)
    draw.text((left, 14 * k), "score of the last second", style.FAINT_INK, ImageFont.load_default(11 * k), anchor="lm")
    for value, y in ((1, top), (0, low)):
        draw.line([(left, y), (right, y)], style.GRID, round(k))
        draw.text((left - 8 * k, y), str(value), style.FAINT_INK, ImageFont.load_default(11 * k), anchor="rm")
    for (_, team), colour in zip(teams, itertools.cycle(PLAYERS)):
        second = math.ceil(1 / team.batch.scenario.control_step)
        smooth = np.convolve([0.0, *team.scores], np.full(second, 1 / second))[first : len(team.scores) + 1]
        points = [(left + (right - left) * n / (last - first), low - (low - top) * v) for n, v in enumerate(smooth)]
        if len(points) > 1:
            draw.line(points, colour, round(2 * k), joint="curve")
    joined = Image.new("RGB", (image.width, image.height + height))
    joined.paste(image)
    joined.paste(strip.resize((image.width, height), Image.Resampling.BOX), (0, image.height))
    return joined


def _gif(frames: Iterator[Image.Image], frame_time: float) -> bytes:
    """Return a GIF that repeats for ever, in the flat colours of frames and their blends with the ground."""
    blends = [style.mix(flat, style.GROUND, share / 6) for share in range(6, 0, -1) for flat in _FLAT]
    table = np.array(list(dict.fromkeys(blends))[:256], np.int32)
    images = []
    for frame in frames:
        # Pillow's own search takes a colour that is only near: the ground for the paper.
        codes, at = np.unique(np.asarray(frame, np.int32) @ (1 << 16, 1 << 8, 1), return_inverse=True)
        apart = np.stack([codes >> 16, codes >> 8 & 255, codes & 255], -1)[:, None] - table
        nearest = (apart**2).sum(axis=-1).argmin(axis=-1).astype(np.uint8)
        images.append(Image.fromarray(nearest[at].reshape(frame.height, frame.width)))
        images[-1].putpalette(table.astype(np.uint8).tobytes())
    shown_for = round(frame_time * 100) * 10  # 1/1000 s; a GIF counts in 1/100 s
    times = [*[shown_for] * (len(images) - 1), max(shown_for, 1500)]  # the last one longer, before it repeats
    file = io.BytesIO()
    images[0].save(file, "GIF", save_all=True, append_images=images[1:], duration=times, loop=0)
    return file.getvalue()


def _mp4(frames: Iterator[Image.Image], frame_time: float) -> bytes:
    """Return an H.264 film; it has even sides, so an odd one loses a pixel."""
    import imageio_ffmpeg

    first = next(frames)
    size = (first.width // 2 * 2, first.height // 2 * 2)
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "film.mp4"
        writer = imageio_ffmpeg.write_frames(str(part), size, fps=1 / frame_time, quality=8, macro_block_size=1)
        writer.send(None)
        for frame in itertools.chain([first], frames):
            writer.send(frame.crop((0, 0, *size)).tobytes())
        writer.close()
        return part.read_bytes()
