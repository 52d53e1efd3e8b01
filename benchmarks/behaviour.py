"""What the learned teams do differently: fills docs/behaviour.md between its marks.

Plays a learned team, the tuned script and the planner on the same worlds, and measures where
trackers drive relative to their slots, how fast, and how often the target darts. The figures in
docs/media show the density of positions.

    python benchmarks/behaviour.py
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import tyro
from comparison import fill
from matplotlib.patches import Circle

import posse
from posse.scenarios.formation import slot_offsets
from posse_baselines import begin, load
from posse_training.provenance import commit
from posse_training.reports.pictures.palette import INK, NOTE
from posse_training.reports.pictures.parts import note, panels
from posse_training.reports.pictures.style import RC

SPAN: Final = 0.6
"""Positions are counted up to this distance ahead of, behind and beside a slot, m."""
EDGES: Final = np.linspace(-SPAN, SPAN, 49)
"""Edges of the cells in which positions are counted, m."""
SCRIPT, REFERENCE = "ddcs-tuned", "planner"
ROWS: Final = (
    "safe score",
    "contact-free",
    "settling time, s",
    "trackers' speed, m/s",
    "trackers' turn rate, either way, rad/s",
    "distance from the nearest slot, m",
    "of it behind the slot, m",
    "target's turn rate, either way, rad/s",
    "darts per episode",
)


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    scenarios: tuple[str, ...] = ("smart", "radio", "search", "obstacles", "field")
    worlds: int = 200
    planner_worlds: int = 50
    seed: int = 3
    split: str = "validation"
    after: float = 20.0
    """Time before the measurement of positions starts, s."""
    page: Path = Path("docs/behaviour.md")


@dataclass(frozen=True)
class Behaviour:
    """What a team did: means by name, and counts of positions relative to the nearest slot."""

    worlds: int
    means: dict[str, float]
    density: npt.NDArray[np.float64]


def look(name: str, scenario: str, worlds: int, s: Settings) -> Behaviour:
    """Play a team, and return what it did."""
    policy = load(name)
    batch = posse.batch(scenario, worlds, seed=s.seed, split=s.split, message_size=policy.message_size)
    scene, trackers, world = batch.scenario, batch.arrays.tracker, batch.worlds
    slots = np.array(slot_offsets(scene))
    observations = batch.reset()
    memory = begin(policy, batch)
    seen: dict[str, list[float]] = {}
    density = np.zeros((len(EDGES) - 1,) * 2)
    darting, darts = np.zeros(worlds, np.bool_), 0
    for step in range(scene.horizon):
        actions, memory = policy.act(observations, memory)
        observations, *_, infos = batch.step(actions)
        now = world["pressed"] < 0
        darts += int((now & ~darting).sum())
        darting = now.copy()
        if step * scene.control_step < s.after:
            continue
        works = trackers["broken_at"] > world["step"][:, None]
        ahead, left = beside(trackers, world, slots)
        near = works & (np.hypot(ahead, left) < SPAN)
        density += np.histogram2d(ahead[near], left[near], bins=(EDGES, EDGES))[0]
        for key, value in {
            "trackers' speed, m/s": trackers["speed"][works],
            "trackers' turn rate, either way, rad/s": np.abs(trackers["turn_rate"][works]),
            "distance from the nearest slot, m": np.hypot(ahead, left)[near],
            "of it behind the slot, m": -ahead[near],
            "target's turn rate, either way, rad/s": np.abs(world["turn_rate"]),
        }.items():
            seen.setdefault(key, []).append(float(value.mean()))
    end = {name.removeprefix("metrics/"): value for name, value in infos.items() if name.startswith("metrics/")}
    settled = end["settling_time"]
    return Behaviour(
        worlds,
        {key: float(np.mean(values)) for key, values in seen.items()}
        | {
            "safe score": float(end["safe_score"].mean()),
            "contact-free": float(end["contact_free"].mean()),
            "settling time, s": float(np.median(settled[settled >= 0])),
            "darts per episode": darts / worlds,
        },
        density,
    )


def beside(trackers: Any, world: Any, slots: npt.NDArray[np.float64]) -> tuple[Any, Any]:
    """Return how far each tracker (E, N) is ahead and to the left of its nearest slot, m."""
    dx, dy = trackers["x"] - world["x"][:, None], trackers["y"] - world["y"][:, None]
    cos, sin = world["frame_cos"][:, None], world["frame_sin"][:, None]
    ahead = (dx * cos + dy * sin)[..., None] - slots[:, 0]
    left = (dy * cos - dx * sin)[..., None] - slots[:, 1]
    nearest = np.hypot(ahead, left).argmin(-1)[..., None]
    return (np.take_along_axis(ahead, nearest, -1)[..., 0], np.take_along_axis(left, nearest, -1)[..., 0])


def draw(found: dict[str, Behaviour], scenario: str, s: Settings, path: Path) -> None:
    """Draw the density of positions around a slot, one panel for each team."""
    scene = posse.get_scenario(scenario)
    with mpl.rc_context(RC):
        figure, axes = panels(1, len(found), 2.9)
        for axis, (name, behaviour) in zip(axes, found.items(), strict=True):
            share = behaviour.density / behaviour.density.sum()
            axis.imshow(
                share,
                origin="lower",
                extent=(-SPAN, SPAN, -SPAN, SPAN),
                cmap="Greys",
                vmax=float(np.quantile(share, 0.999)),
                interpolation="nearest",
            )
            axis.add_patch(Circle((0, 0), scene.tolerance, fill=False, edgecolor=INK, linewidth=1.2))
            axis.plot(0, 0, "+", color=NOTE)
            axis.set(title=name, xlabel="to the left of the slot, m", xlim=(SPAN, -SPAN))
            axis.set_aspect("equal")
        axes[0].set_ylabel("ahead of the slot, m")
        worlds = ", ".join(f"{name} {each.worlds}" for name, each in found.items())
        note(
            figure,
            f"{scenario} v{scene.version}, {s.split} split, seed {s.seed}, worlds: {worlds}; after {s.after:g} s",
        )
        figure.savefig(path, metadata={"Date": None})


def main() -> None:
    """Play everything; write the page and its figures."""
    s = tyro.cli(Settings)
    made = (
        f"Made by `python benchmarks/behaviour.py` at commit `{commit()}`: {s.worlds} worlds "
        f"(planner: {s.planner_worlds}) of the `{s.split}` split, seed {s.seed}. All rows but the "
        f"first three and the last are means over trackers, worlds and steps after {s.after:g} s."
    )
    lines = [made, ""]
    for scenario in s.scenarios:
        teams = {f"learned-{scenario}": s.worlds, SCRIPT: s.worlds, REFERENCE: s.planner_worlds}
        found = {name: look(name, scenario, worlds, s) for name, worlds in teams.items()}
        picture = s.page.parent / "media" / f"behaviour-{scenario}.svg"
        draw(found, scenario, s, picture)
        caption = f"Trackers relative to their nearest slot on {scenario}; circle: its tolerance."
        lines += [
            f"### {scenario}",
            "",
            f"![{caption}](media/{picture.name})",
            "",
            f"*{caption}*",
            "",
            "| | " + " | ".join(f"`{name}`" for name in found) + " |",
            "|---" * (1 + len(found)) + "|",
        ]
        for row in ROWS:
            lines.append(f"| {row} | " + " | ".join(f"{b.means[row]:.2f}" for b in found.values()) + " |")
        lines.append("")
        print(f"{scenario} done", flush=True)
    fill(s.page, "\n".join(lines))


if __name__ == "__main__":
    main()
