"""Makes a trained team or target part of the package; its card has every training seed's scores, and a check.

    python scripts/ship.py runs/train/smart-ppo-1 runs/train/smart-ppo-2 --name learned-smart
    python scripts/ship.py runs/train/duel-target-ppo-1 --name evader
    python scripts/ship.py --again     the checks of all that ship, after a scenario's version rose

Of several runs that differ in their training seeds, the best on validation worlds that none was evaluated on ships,
against the targets of its training.
Then all play the worlds of the leaderboard, for the mean over training seeds. A target ships only if it costs the
reference team more than the scripted one.
"""

import csv
import dataclasses
import shlex
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import numpy.typing as npt
import tyro

from posse import Family, Scenario, get_scenario
from posse.scenarios.family import blocks
from posse_baselines import Target, load_target
from posse_baselines.learned import LearnedPolicy
from posse_baselines.registry import SHIPPED, SHIPPED_TARGETS
from posse_training.errors import SettingsError
from posse_training.evaluation.evaluation import evaluate
from posse_training.evaluation.results import block_of
from posse_training.evaluation.statistics import difference, mean
from posse_training.leaderboard import SEED, WORLDS
from posse_training.options import words_of
from posse_training.provenance import commit
from posse_training.train.presets import default_settings
from posse_training.train.settings import BEST, SETTINGS, TrainSettings, read_settings

LEARNED: Final = ("learned-", "corrected-")
"""Prefixes of the names of teams: networks that act, and networks that correct a script."""
SPLIT: Final = "validation"
CHOICE_SEED: Final = 1  # seed 0 is evaluated during training
CHECK_SEED: Final = 2
CHECK_WORLDS: Final = 32
TARGET_SEED: Final = 7
TARGET_WORLDS: Final = 16
LARGEST: Final = 1_000_000
"""Largest size of a shipped file, bytes."""
REFERENCE: Final = ("ddcs-tuned", "smart", 0.10)
"""A target must cost this team, compared with this scripted target, at least this share of the score."""
_JUDGED: Final = ("safe_score", "score", "contact_free")
"""The first one decides; the others are stated beside it."""
_MAY_DIFFER: Final = frozenset(
    ("seed", "folder", "steps", "evaluate_every", "evaluate_worlds", "beside", "checkpoint_every", "threads")
) | {"tensorboard", "wandb", "target", "team", "start"}  # those of a league are the members of its own
_NOT_PLAYED: Final = {"name", "version", "reward_weights", "target_reward_weights", "message_size"}
"""Fields of a scenario that change no score, or that a check states separately."""


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Run folders; those of a team differ in their training seeds only."""
    name: str = ""
    """Name of the team, learned-..., or of the target."""
    worlds: int = 200
    """Worlds of each scenario and team size to judge on."""
    test_worlds: int = WORLDS
    """Worlds of the leaderboard that every training seed plays, likewise."""
    out: Path | None = None
    """Folder to write to; default: the package's own."""
    again: bool = False
    """Make the checks of all shipped teams anew."""


def ship(settings: Settings) -> Path:
    """Write the best policy of some runs to the package; return its file.

    Raises:
        SettingsError: Runs that differ in more than their seeds, a wrong name, a target that costs too little, or a
            policy that is too large; nothing is written.
        PolicyError: A run without a policy, or with a damaged one.
    """
    if not settings.runs:
        raise SettingsError("no run folders given: pass at least one")
    trained = [read_settings(run / SETTINGS) for run in settings.runs]
    policies = [LearnedPolicy.from_file(run / BEST) for run in settings.runs]
    make = _team if trained[0].side == "trackers" else _target
    policy = make(settings, trained, policies)
    home = SHIPPED if trained[0].side == "trackers" else SHIPPED_TARGETS
    path = (settings.out or home) / f"{settings.name}.safetensors"
    with tempfile.TemporaryDirectory() as folder:
        policy.save(trial := Path(folder, path.name))
        size = trial.stat().st_size
    if size > LARGEST:
        raise SettingsError(
            f"{path} would have {size:,} bytes, {LARGEST:,} are allowed: train with smaller hidden layers"
        )
    policy.save(path)
    return path


def _team(settings: Settings, trained: Sequence[TrainSettings], policies: Sequence[LearnedPolicy]) -> LearnedPolicy:
    if not settings.name.startswith(LEARNED):
        raise SettingsError(f"name={settings.name!r} must begin with {' or '.join(LEARNED)}")
    _check_one_training(settings.runs, trained)
    given, choice = trained[0].given, (settings.worlds, CHOICE_SEED, SPLIT)
    plays = [_play(policy, given, *choice) for policy in policies]
    tests = [_play(policy, given, settings.test_worlds, SEED, "test") for policy in policies]
    # A run may end where it began, as the policy that it corrects or copies: that is none to ship.
    learned = [policy.card["steps"] > 0 for policy in policies]
    scores = [play["safe_score"].mean() for play in plays]
    # Against the targets of the training, by their shares, unless each run had those of its own league.
    targets = trained[0].opponents if all(run.opponents == trained[0].opponents for run in trained) else {}
    if targets:
        each = [[_play(policy, given, *choice, name)["safe_score"].mean() for name in targets] for policy in policies]
        scores = list(np.average(each, axis=1, weights=list(targets.values())))
    block = max(map(block_of, given))
    best = int(np.argmax(np.where(learned if any(learned) else True, scores, -np.inf)))
    seeds = [
        {
            "seed": run.seed,
            "steps": policy.card.get("steps"),
            "commit": policy.card.get("commit"),
            "command": command_of(run),
            **{name: asdict(mean(play[name], block)) for name in _JUDGED},
            "test": {name: asdict(mean(test[name], block)) for name in _JUDGED},
        }
        for run, policy, play, test in zip(trained, policies, plays, tests, strict=True)
    ]
    return policies[best].with_card(
        {
            **_card(settings.name, policies[best], trained[best]),
            "chosen_on": SPLIT,
            "training_seeds": seeds,
            "choice": {"split": SPLIT, "seed": CHOICE_SEED, "worlds": settings.worlds, "targets": targets},
            **{f"validation_{name}": float(plays[best][name].mean()) for name in _JUDGED},
            "curve": _curve(settings.runs[best]),
            "check": make_check(policies[best], [_first(each) for each in given]),
        }
    )


def _play(
    policy: LearnedPolicy,
    scenarios: Sequence[Scenario | Family],
    worlds: int,
    seed: int,
    split: str,
    target: str | None = None,
) -> dict[str, npt.NDArray[np.float64]]:
    """Return what a policy is judged by in each world, its mean over all scenarios and families."""
    played = [evaluate(policy, scenario, worlds, seed, split=split, target=target) for scenario in scenarios]
    return {name: np.mean([results[name] for results in played], axis=0) for name in _JUDGED}


def _first(given: Scenario | Family) -> Scenario:
    """Return the scenario, or the first one of a family that a check draws."""
    return next(blocks(given, range(1), CHECK_SEED, SPLIT))[0]


def _target(settings: Settings, trained: Sequence[TrainSettings], policies: Sequence[LearnedPolicy]) -> LearnedPolicy:
    if len(policies) != 1:
        raise SettingsError(f"a target ships from one run, these are {len(policies)}")
    (policy,), scenario = policies, _first(trained[0].given[0])
    new = Target(settings.name, "agent", policy)
    comparison = make_comparison(scenario, new, settings.worlds)
    card = {**_card(settings.name, policy, trained[0]), "comparison": comparison}
    return policy.with_card({**card, "check": make_target_check(REFERENCE[0], scenario, new)})


def make_comparison(scenario: Scenario, new: Target, worlds: int) -> dict[str, Any]:
    """Return what a target costs the reference team, compared with the scripted one; SettingsError if too little."""
    team, scripted, least = REFERENCE
    played = {
        target.name: evaluate(team, scenario, worlds, TARGET_SEED, target=target, progress=False)
        for target in (load_target(scripted), new)
    }
    cost = difference(played[scripted]["score"], played[new.name]["score"])
    if not cost.low >= least:
        raise SettingsError(f"{new.name!r} costs {team} {cost} more than {scripted!r}: at least {least:g} is wanted")
    told = {"team": team, "split": "test", "seed": TARGET_SEED, "worlds": worlds, "cost": asdict(cost)}
    return {**told, "scores": {name: asdict(found.estimate("score")) for name, found in played.items()}}


def _card(name: str, policy: LearnedPolicy, run: TrainSettings) -> dict[str, Any]:
    told = {"name": name, "settings": run.to_dict(), "command": command_of(run)}
    return {**policy.card, **told, "shipped_at": commit()}


def _curve(run: Path) -> list[dict[str, float]]:
    """Return the whole learning curve of a run; that on the card of its best policy ends with it."""
    with (run / "curve.csv").open(newline="", encoding="utf-8") as file:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]


def _check_one_training(runs: Sequence[Path], trained: Sequence[TrainSettings]) -> None:
    seeds, first = [run.seed for run in trained], trained[0].to_dict()
    if len(set(seeds)) < len(seeds):
        raise SettingsError(f"the runs must have different training seeds, these have {seeds}")
    for folder, run in zip(runs, trained, strict=True):
        other = run.to_dict()
        differing = [name for name in other if other[name] != first[name] and name not in _MAY_DIFFER]
        if differing:
            raise SettingsError(
                f"{runs[0]} and {folder} must differ in their seeds only: they differ in {', '.join(differing)}"
            )


def make_check(policy: LearnedPolicy, scenarios: Sequence[Scenario]) -> dict[str, Any]:
    """Return the scores of a policy on a few fixed worlds of each scenario, which tests reproduce."""
    plays = [{"scenario": s.name, "version": s.version, "settings": _settings_of(s)} for s in scenarios]
    worlds = max(4, CHECK_WORLDS // len(scenarios))
    check: dict[str, Any] = {"split": SPLIT, "seed": CHECK_SEED, "worlds": worlds, "plays": plays}
    for play, score in zip(plays, replay(policy, check), strict=True):
        play["score"] = score
    return check


def replay(policy: LearnedPolicy, check: Mapping[str, Any]) -> list[float]:
    """Return the current scores of a policy on the worlds of a check."""
    played = {"split": check["split"], "progress": False}
    return [
        float(evaluate(policy, scenario, check["worlds"], check["seed"], **played)["score"].mean())
        for scenario in check_scenarios(check)
    ]


def check_scenarios(check: Mapping[str, Any]) -> list[Scenario]:
    """Return the scenarios of a check, in their current versions."""
    return [
        get_scenario(
            play["scenario"], **{name: tuple(v) if isinstance(v, list) else v for name, v in play["settings"].items()}
        )
        for play in check["plays"]
    ]


def make_target_check(team: str, scenario: Scenario, target: Target) -> dict[str, Any]:
    """Return the score of a team against a target on a few validation worlds, which tests reproduce."""
    worlds = {"split": SPLIT, "seed": TARGET_SEED}
    played = evaluate(team, scenario, TARGET_WORLDS, target=target, progress=False, **worlds)  # type: ignore[arg-type]
    told = {"team": team, "scenario": scenario.name, "version": scenario.version}
    return {**told, **worlds, "worlds": TARGET_WORLDS, "score": float(played["score"].mean())}


def _settings_of(scenario: Scenario) -> dict[str, Any]:
    """Return the settings that differ from those of the named scenario."""
    named = get_scenario(scenario.name)
    names = [field.name for field in dataclasses.fields(scenario) if field.name not in _NOT_PLAYED]
    return {name: getattr(scenario, name) for name in names if getattr(scenario, name) != getattr(named, name)}


def command_of(settings: TrainSettings) -> str:
    """Return the command that trains with these settings, in the default folder."""
    side = settings.side
    default = default_settings(settings.scenario, settings.algorithm, side=side).to_dict()
    stated = {"scenario", "algorithm", "steps", "seed"}
    if side == "target":
        stated |= {"side", "team"}
    words = ["posse", "train"]
    for name, value in settings.to_dict().items():
        if name == "folder" or (value == default[name] and name not in stated):
            continue
        option = name.replace("_", "-")
        if isinstance(value, bool):
            words.append(f"--{option}" if value else f"--no-{option}")
        elif isinstance(value, dict):
            words += ["--set" if name == "overrides" else f"--{option}", *words_of(value)]
        elif name in ("scenario", "target", "team"):
            words += [f"--{option}", *str(value).split(",")]
        elif isinstance(value, (tuple, list)):
            words += [f"--{option}", *map(str, value)]
        else:
            words += [f"--{option}", str(value)]
    return shlex.join(words)


def _check_again(path: Path, check: dict[str, Any], **more: Any) -> None:
    policy = LearnedPolicy.from_file(path)
    policy.with_card({**policy.card, "check": check, "checked_at": commit(), **more}).save(path)
    print(path.stem, *(f"{play['scenario']} {play['score']:.3f}" for play in check.get("plays", [check])))


def _check_all_again() -> None:
    made: list[tuple[Path, dict[str, Any], dict[str, Any]]] = []
    for path in sorted(SHIPPED_TARGETS.glob("*.safetensors")):
        card, target = LearnedPolicy.from_file(path).card, load_target(path.stem)
        scenario = get_scenario(card["check"]["scenario"])
        # It may refuse a target: before any file is written.
        comparison = make_comparison(scenario, target, card["comparison"]["worlds"])
        made.append((path, make_target_check(REFERENCE[0], scenario, target), {"comparison": comparison}))
    for path in sorted(SHIPPED.glob("*.safetensors")):
        policy = LearnedPolicy.from_file(path)
        made.append((path, make_check(policy, check_scenarios(policy.card["check"])), {}))
    for path, check, more in made:
        _check_again(path, check, **more)


def main() -> None:
    """Ship, or check all that ships anew."""
    settings = tyro.cli(Settings, description=__doc__)
    if settings.again:
        _check_all_again()
        return
    path = ship(settings)
    card = LearnedPolicy.from_file(path).card
    for run in card.get("training_seeds", ()):
        print(f"training seed {run['seed']}: safe score {run['safe_score']['value']:.3f}")
    print(f"{path} holds training seed {card['seed']}")


if __name__ == "__main__":
    main()
