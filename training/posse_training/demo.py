"""``posse demo``: how a script, a learned team and the planner do, and a replay and a film of the first two."""

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

import numpy as np
import tyro
from rich.console import Console

from posse import ObservationLayout, batch, get_scenario
from posse_baselines import load
from posse_training.errors import SettingsError
from posse_training.evaluation import evaluate
from posse_training.evaluation.evaluation import progress_bar
from posse_training.film import film
from posse_training.parallel import apart
from posse_training.replay import record, write_replay

SCENARIO: Final = "smart"
TEAMS: Final = {"script": "ddcs-tuned", "learned": "learned-smart", "planner": "planner"}
SHOWN: Final = ("ddcs-tuned", "learned-smart")  # in the replay and the film
SEED: Final = 7
_PLANNED: Final = 5  # a world of the planner takes as long as many of a script: it plays one in so many
_COMPILING: Final = 300.0  # s, at most


def main(arguments: Sequence[str]) -> None:
    """Run the demo."""
    tyro.cli(demo, prog="posse demo", args=arguments)


def demo(episodes: int = 50, seconds: float = 12.0, out: Path = Path("runs/demo")) -> None:
    """Print which share of its slots each team holds, with 95 % intervals; write a replay page and a film.

    Args:
        episodes: Worlds for each team; the planner plays a fifth of them.
        seconds: Simulated time of the film, s.
        out: Folder to write to.
    """
    if episodes < 2:
        raise SettingsError(f"episodes={episodes} is too few for an interval: 2 or more")
    if not 0 < seconds <= 3600:
        raise SettingsError(f"seconds={seconds} is not a length of a film: 0 to 3,600")
    console, started = Console(), time.perf_counter()
    with progress_bar() as bar:
        task = bar.add_task("compiling, which takes longest the first time", total=len(TEAMS) + 3)
        with ThreadPoolExecutor(1) as pool:  # the policies in a process of their own, beside the worlds
            pool.submit(apart, _COMPILING, _compile_policies)
            batch(SCENARIO, 1).reset()
        bar.advance(task)
        lines = []
        for kind, name in TEAMS.items():
            bar.update(task, description=f"{name} plays")
            worlds = episodes if kind != "planner" else max(2, episodes // _PLANNED)
            held = evaluate(name, SCENARIO, worlds, SEED, progress=False).estimate("safe_score")
            percent, off = 100 * held.value, 50 * (held.high - held.low)
            lines.append(f"{kind:<8} {name:<14} held {percent:.0f} ± {off:.0f} % of its slots in {worlds} worlds")
            bar.advance(task)
        bar.update(task, description="writing the replay page")
        page = write_replay(record(list(SHOWN), SCENARIO, seed=SEED), out / "replay.html")
        bar.update(task, advance=1, description="filming")
        teams, path = [(name, load(name)) for name in SHOWN], out / f"{SCENARIO}.gif"
        start = min(15.0, get_scenario(SCENARIO).duration - seconds)
        film(
            teams, SCENARIO, path=path, seed=SEED, start=max(0.0, start), seconds=seconds, speed=2, every=4, scores=True
        )
    for line in lines:
        console.print(line, markup=False, highlight=False)
    console.print(f"Scenario {SCENARIO}; from a contact on nothing counts; the planner knows the state.")
    console.print(f"replay: {page} (open it in a browser)", markup=False, soft_wrap=True)
    console.print(f"film:   {path}", markup=False, soft_wrap=True)
    console.print(f"total time: {time.perf_counter() - started:.0f} s")


def _compile_policies() -> None:
    """Have every team act once, which compiles what it needs."""
    for name in TEAMS.values():
        policy = load(name)
        layout = ObservationLayout(get_scenario(SCENARIO, message_size=policy.message_size))
        if not policy.reads_state:
            policy.act(np.zeros((1, layout.scenario.num_trackers, layout.size), np.float32), policy.begin(layout, 1))
