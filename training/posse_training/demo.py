"""A table of scores, a film of the best team for each target motion, and a replay page."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import current_process, get_context
from pathlib import Path
from typing import Final

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from posse import ObservationLayout, get_scenario
from posse_baselines import Policy, load, policy_names
from posse_training.evaluation import Results, evaluate
from posse_training.evaluation.evaluation import progress_bar
from posse_training.evaluation.statistics import Estimate, mean, share
from posse_training.film import film
from posse_training.replay import record, write_replay

SCENARIOS: Final = ("constant", "accelerating", "smart")
POLICIES: Final = ("random", "idle", "pursuit", "ddcs-centralized", "ddcs-distributed", "ddcs-tuned")
LEARNED: Final = "learned-smart"
"""Plays the scenario that it was trained on, if it is shipped."""
UNCOMPILED: Final = ("random", "idle")
"""Policies that compile in no time."""
EPISODES: Final = 500
SEED: Final = 7
FOLDER: Final = Path("runs/demo")


def main(episodes: int = EPISODES, seconds: float = 25.0) -> None:
    """Play every policy in every scenario, print the table, film the best and write a replay page.

    A second process compiles the policies while this one compiles the worlds; then it renders the
    films while this one plays.

    Args:
        episodes: Worlds for each policy and scenario.
        seconds: Simulated time of a film, s.
    """
    _refuse_unguarded()
    console = Console()
    started = time.perf_counter()
    plays = [(scenario, policy) for scenario in SCENARIOS for policy in POLICIES]
    if LEARNED in policy_names():
        plays.append(("smart", LEARNED))
    policies = {name: load(name) for _, name in plays}
    results: dict[tuple[str, str], Results] = {}
    films: dict[str, Future[Path]] = {}
    with ProcessPoolExecutor(1, get_context("spawn"), initializer=_mute) as helper, progress_bar() as bar:
        compiled = helper.submit(compile_policies, list(policies.values()))
        task = bar.add_task("compiling, then playing", total=len(plays))
        for k, (scenario, name) in enumerate(plays):
            if name not in UNCOMPILED:
                compiled.result()
            bar.update(task, description=f"{name} on {scenario}")
            results[scenario, name] = evaluate(policies[name], scenario, episodes, SEED, progress=False)
            bar.advance(task)
            if k + 1 == len(plays) or plays[k + 1][0] != scenario:
                names = shown(scenario, results)
                films[f"{' beside '.join(names)} on {scenario}"] = helper.submit(
                    film,
                    [(n, policies[n]) for n in names],
                    scenario,
                    seed=SEED,
                    world=0,
                    path=FOLDER / f"{scenario}.gif",
                    split="test",
                    seconds=seconds,
                )
        bar.update(task, description="filming")
        paths = {title: made.result() for title, made in films.items()}
        bar.update(task, description="writing the replay page")
        names = shown(SCENARIOS[-1], results)
        replay = record([policies[name] for name in names], SCENARIOS[-1], seed=SEED, split="test")
        page = write_replay(replay, FOLDER / "replay.html")
    console.print(table(results))
    for title, path in paths.items():
        console.print(f"{title}: {path}", markup=False, soft_wrap=True)
    console.print(
        f"{' beside '.join(names)} on {SCENARIOS[-1]}, to open in a browser: {page}", markup=False, soft_wrap=True
    )
    console.print(f"total time: {time.perf_counter() - started:.0f} s")


def _refuse_unguarded() -> None:
    """End the second process if it is running a script without a main guard again, from its top."""
    if getattr(current_process(), "_inheriting", False):
        raise SystemExit(
            "the demo starts a second process, which runs this script again from its top: put what the script does "
            'below a line `if __name__ == "__main__":`'
        )


def _mute() -> None:
    """Silence the second process; its errors are raised in this one."""
    sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115 (open until the process ends)


def compile_policies(policies: Sequence[Policy]) -> None:
    """Call each policy once, so that its compiled code is cached on disk."""
    for policy in policies:
        layout = ObservationLayout(get_scenario("smart", message_size=policy.message_size))
        observations = np.zeros((1, layout.scenario.num_trackers, layout.size), np.float32)
        policy.act(observations, policy.begin(layout, 1))


def shown(scenario: str, results: Mapping[tuple[str, str], Results]) -> list[str]:
    """Return the policies to film: the best scripted one, and the learned one if it played."""
    best = max(POLICIES, key=lambda name: results[scenario, name]["safe_score"].mean())
    return [best, LEARNED] if (scenario, LEARNED) in results else [best]


def table(results: dict[tuple[str, str], Results]) -> Table:
    """Return the table of scores, with 95 % intervals."""
    episodes = next(iter(results.values())).episodes
    made = Table(
        title=f"{episodes} worlds each, split test, seed {SEED}; 95 % intervals",
        box=box.HORIZONTALS,  # no vertical bars: the figures need all of 80 characters
        collapse_padding=True,
        pad_edge=False,
    )
    made.add_column("target", no_wrap=True)
    made.add_column("policy", no_wrap=True)
    for column in ("safe score", "tracking error, m", "settled", "settling time, s"):
        made.add_column(column)
    made.add_column("worlds with a contact")
    keys = list(results)
    for k, ((scenario, name), result) in enumerate(results.items()):
        follows = k > 0 and keys[k - 1][0] == scenario
        ends = k + 1 == len(keys) or keys[k + 1][0] != scenario
        made.add_row(
            "" if follows else scenario,
            name,
            *(
                _cell(estimate)
                for estimate in (
                    mean(result["safe_score"]),
                    mean(result["tracking_error"]),
                    share(result.settled),
                    mean(result["settling_time"]),
                    share(result.contacts > 0),
                )
            ),
            end_section=ends,
        )
    return made


def _cell(estimate: Estimate) -> str:
    if estimate.count == 0:
        return "never"
    return f"{estimate.value:.2f}\n[{estimate.low:.2f}, {estimate.high:.2f}]"
