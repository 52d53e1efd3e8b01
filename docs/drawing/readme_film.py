"""Makes docs/media/smart.gif, the film of the README, and the strip of scores below it.

    python docs/drawing/readme_film.py

The tuned script and the learned team in one world of `smart`, seen by one camera, and for each the
score of the last second. The world is no extreme: of the first 101, it has the median difference
of the safe scores. The command prints what a caption may say.
"""

from __future__ import annotations

import io
import tempfile
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib import pyplot as plt
from PIL import Image

from posse.rendering.style import PLAYERS
from posse_baselines import load
from posse_training.evaluation import evaluate
from posse_training.replay import Replay, record
from posse_training.reports.pictures.film import film
from posse_training.reports.pictures.gif import write_gif
from posse_training.reports.pictures.style import RC

OUT: Final = Path(__file__).parents[1] / "media" / "smart.gif"
TEAMS: Final = ("ddcs-tuned", "learned-smart")
SCENARIO: Final = "smart"
SEED, WORLDS = 7, 101
START, SECONDS, SPEED, EVERY = 15.0, 20.0, 2.0, 3
WIDTH, HEIGHT, STRIP = 600, 290, 100  # px
STEP: Final = 0.1  # s
LEFT, RIGHT = 0.085, 0.96  # the strip's axes, as shares of the width

Frame = npt.NDArray[np.uint8]


def median_world() -> int:
    """Return the world with the median difference of the teams' safe scores."""
    first, second = (evaluate(name, SCENARIO, WORLDS, SEED, progress=False)["safe_score"] for name in TEAMS)
    for name, scores in zip(TEAMS, (first, second), strict=True):
        print(f"{name}: mean safe score of {WORLDS} worlds {scores.mean():.3f}")
    print(f"{TEAMS[1]} has the higher one in {(second > first).sum()}")
    return int(np.argsort(second - first, kind="stable")[WORLDS // 2])


def strip(replay: Replay) -> Frame:
    """Draw the scores of the teams over the film's time, (STRIP, WIDTH, 3)."""
    with mpl.rc_context(RC):
        figure = plt.figure(figsize=(WIDTH / 100, STRIP / 100), dpi=100)
        axes = figure.add_axes((LEFT, 0.24, RIGHT - LEFT, 0.52))
        for player, colour, line in zip(replay.players, PLAYERS, ("-", "--"), strict=False):
            score = np.asarray(player.columns["score"].values, np.float64)
            smooth = np.convolve(score, np.full(10, 0.1))[: len(score)]  # of the last second
            time = np.arange(len(score)) * STEP
            axes.plot(time, smooth, line, color=[c / 255 for c in colour], label=player.name)
        axes.set_xlim(START, START + SECONDS)
        axes.set_ylim(-0.05, 1.08)
        axes.set_yticks((0, 1))
        axes.set_ylabel("score")
        axes.set_xticks(ticks := np.arange(START, START + SECONDS + 1, 5), [f"{t:g} s" for t in ticks])
        axes.tick_params(labelsize=8)
        axes.legend(ncols=2, loc="lower right", bbox_to_anchor=(1.0, 0.92), frameon=False, fontsize=8)
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png")
        plt.close(figure)
    return np.asarray(Image.open(drawn).convert("RGB"))


def frames(path: Path) -> list[Frame]:
    """Return the frames of a GIF."""
    with Image.open(path) as image:
        found = []
        for number in range(getattr(image, "n_frames", 1)):
            image.seek(number)
            found.append(np.asarray(image.convert("RGB")))
    return found


def main() -> None:
    """Make the film."""
    mpl.use("Agg")
    world = median_world()
    replay = record(list(TEAMS), SCENARIO, seed=SEED, world=world, seconds=START + SECONDS, observations=False)
    filmed = slice(round(START / STEP), None)
    for player in replay.players:
        score = player.columns["score"].values[filmed].mean()
        touches = sum(event.kind == "contact" for event in player.events)
        print(f"world {world}, {player.name}: mean score in the film {score:.2f}, contacts {touches}")
    below = strip(replay)
    with tempfile.TemporaryDirectory() as folder:
        options: dict[str, Any] = {"start": START, "size": (WIDTH, HEIGHT)}
        path = film(
            [(name, load(name)) for name in TEAMS],
            SCENARIO,
            path=Path(folder) / "film.gif",
            seed=SEED,
            world=world,
            seconds=SECONDS,
            speed=SPEED,
            every=EVERY,
            **options,
        )
        above = frames(path)
    joined = []
    for number, frame in enumerate(above):
        now = min(number * EVERY * STEP, SECONDS) / SECONDS
        column = round(WIDTH * (LEFT + (RIGHT - LEFT) * now))
        marked = below.copy()
        marked[24:76, max(column - 1, 0) : column + 1] = (120, 120, 120)
        joined.append(np.concatenate([frame[:, :WIDTH], marked[:, : frame.shape[1]]]))
    write_gif(OUT, joined, EVERY * STEP / SPEED)
    print(f"{OUT}: {len(joined)} frames, {OUT.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
