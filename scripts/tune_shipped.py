"""``make tune``: repeat every tuning run whose result ships, by the command on its card; interrupted, it resumes.

python scripts/tune_shipped.py --again     only the checks of all that ship, after a scenario's version rose
"""

import json
import shlex
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import tyro
from rich.console import Console

import posse
from posse_baselines.files import write_atomically, write_json
from posse_baselines.tuned import TUNED, tuned_files
from posse_training import evaluate
from posse_training.tune import TuneSettings, tune


def repeat_all(folder: Path, console: Console) -> Iterator[Path]:
    """Repeat the runs of all shipped files in run folders below one, and write these again; yield the results."""
    for name in TUNED:
        for path in tuned_files(name).values():
            card = json.loads(path.read_text(encoding="utf-8"))
            settings = tyro.cli(TuneSettings, args=shlex.split(card["command"])[2:])
            only = tuple(each for each in settings.only if each not in card.get("dropped", ()))  # settings since gone
            out = folder / f"{settings.policy}-{settings.scenario}-{settings.seed}"
            found = tune(replace(settings, only=only, out=out), console=console)
            write_atomically(path, found.read_bytes())
            yield found


def check_all() -> Iterator[str]:
    """Play the checks of all shipped files on today's versions, write their scores, and yield old and new ones.

    The card keeps the version that the settings were tuned on.
    """
    for name in TUNED:
        for path in tuned_files(name).values():
            card = json.loads(path.read_text(encoding="utf-8"))
            check, before = card["check"], card["check"]["safe_score"]
            played = evaluate(name, path.stem, check["worlds"], check["seed"], split=check["split"], progress=False)
            check["safe_score"] = float(played["safe_score"].mean())
            card.setdefault("tuned_version", card["scenario_version"])
            card["scenario_version"] = posse.get_scenario(path.stem).version
            write_json(path, card)
            yield f"{name} {path.stem}: {before:.3f} -> {check['safe_score']:.3f}"


if __name__ == "__main__":
    if sys.argv[1:] == ["--again"]:
        for line in check_all():
            print(line, flush=True)
        sys.exit()
    for result in repeat_all(Path("runs/tune/shipped"), Console()):
        print(result)
