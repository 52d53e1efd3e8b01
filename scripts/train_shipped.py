"""``make train-shipped``: train the corrections that ship, and the teams that learned one scenario from nothing.

Finished runs are skipped, an interrupted one resumes. To use more cores, start it for several scenarios at once.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import tyro
from rich.console import Console

from posse_baselines.policies.open_loop import OPEN_LOOP
from posse_training.errors import SettingsError
from posse_training.league import LeagueSettings, play_league
from posse_training.train.presets import default_settings
from posse_training.train.settings import LAST, TrainSettings
from posse_training.train.train import train

CORRECTIONS: Final = ("smart", "field", "duel", "robots")
"""Scenarios with a team that corrects the script, ``corrected-SCENARIO``."""
LEAGUE: Final = LeagueSettings(
    scenario="duel", generations=4, seed=1, target_steps=1_500_000, responses="none", folder=Path("runs/league-1")
)
EVADERS: Final = ("evader", "evader-2", "evader-3")
"""The last targets of three leagues."""
DUEL: Final[dict[str, Any]] = {
    "target": ",".join(("smart", "constant", *OPEN_LOOP, *(each for each in EVADERS for _ in range(3)))),
    "num_worlds": 266,
}
"""Opponents of the teams of ``duel``, the evaders with three shares each."""
AFTER_LEAGUE: Final[dict[str, Any]] = {"steps": 6_000_000, "start": str(LEAGUE.path / "generation-04" / "trackers")}
"""How the one that learned from nothing goes on from the league's last team."""
FROM_NOTHING: Final = ("smart", "radio", "leader-loss", "obstacles", "search", "field", "robots", "duel")
"""Scenarios with a team that learned from nothing, ``learned-SCENARIO``."""
SCENARIOS: Final = tuple(dict.fromkeys((*CORRECTIONS, *FROM_NOTHING)))
"""Scenarios with a team of their own."""


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    seed: tuple[int, ...] = (1, 2, 3)
    """Training seeds."""
    scenario: tuple[str, ...] = SCENARIOS
    """Scenarios to train on."""
    out: Path = Path("runs/shipped")
    """Folder of the run folders, TEAM-SEED."""


def all_runs(settings: Settings) -> list[TrainSettings]:
    """Return the settings of all runs, the first seed of every scenario first."""
    for name in settings.scenario:
        if name not in SCENARIOS:
            raise SettingsError(
                f"scenario={name!r:.80} has no learned team of its own; those that have: {', '.join(SCENARIOS)}"
            )
    runs = []
    for seed in settings.seed:
        for name in settings.scenario:
            opponents = DUEL if name == "duel" else {}
            if name in CORRECTIONS:
                corrects = replace(default_settings(name, preset="residual"), **opponents)
                runs.append(replace(corrects, seed=seed, folder=settings.out / f"corrected-{name}-{seed}"))
            if name in FROM_NOTHING:
                learns = replace(default_settings(name), **opponents, **(AFTER_LEAGUE if name == "duel" else {}))
                runs.append(replace(learns, seed=seed, folder=settings.out / f"learned-{name}-{seed}"))
    return runs


if __name__ == "__main__":
    console = Console()
    for run in all_runs(tyro.cli(Settings, description=__doc__)):
        if (run.run_folder / LAST).is_file():
            console.print(f"finished: {run.run_folder}", markup=False)
            continue
        if run.start is not None:
            play_league(LEAGUE, console=console)  # trains what is missing
        train(run, console=console)
