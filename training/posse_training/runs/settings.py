"""Everything that a training is a function of: one typed, frozen class, and its defaults."""

from __future__ import annotations

import dataclasses
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any, Final, Literal

from posse import Scenario, get_scenario
from posse_baselines import load

ALGORITHMS: Final = ("ppo", "mappo", "sac", "td3")


class SettingsError(ValueError):
    """A setting that no training can have."""


@dataclass(frozen=True, kw_only=True)
class TrainSettings:
    """Settings of a training; the defaults depend on scenario and algorithm.

    A *step* is one control step of one tracker.
    """

    scenario: str = "smart"
    """What to train on: a scenario, or several with commas between them."""
    algorithm: Literal["ppo", "mappo", "sac", "td3"] = "ppo"
    """mappo is ppo with a value function that sees the state of the world."""
    steps: int = 20_000_000
    """Steps to train for."""
    seed: int = 1
    """Of the worlds, the networks and the exploration."""
    folder: Path | None = None
    """Where everything is written; default: runs/train/SCENARIO-ALGORITHM-SEED."""

    # The worlds
    num_worlds: int = 256
    """Worlds stepped together, of all scenarios and team sizes taken together."""
    team_sizes: tuple[int, ...] = ()
    """Numbers of trackers to train with; none: the scenario's own."""
    num_neighbours: int | None = None
    """Team-mates that the policy reads, nearest first; default: as many as there are places."""
    message_size: int = 0
    """Numbers that a tracker may tell its team-mates in each step."""
    overrides: dict[str, bool | int | float | str] = field(default_factory=dict)
    """Settings of the scenario that are to be other than it has them."""
    reward_weights: dict[str, float] = field(default_factory=dict)
    """Weight of each reward term; none: the scenario's own."""

    # The networks
    encoding: Literal["plain", "slots"] = "slots"
    """What the policy is given: the observation, or what follows from it as well."""
    hidden: tuple[int, ...] = (64, 64)
    """Widths of the hidden layers, of policy and value function alike."""
    activation: Literal["tanh", "relu"] = "tanh"
    """Between the layers."""

    # What every algorithm has
    learning_rate: float = 3e-4
    """At the start."""
    final_learning_rate: float = 3e-5
    """At the end; in between it falls linearly."""
    discount: float = 0.99
    """Of rewards, for each control step."""
    minibatch: int = 8192
    """Steps in one gradient."""

    # ppo and mappo
    rollout: int = 64
    """Control steps between two updates."""
    epochs: int = 4
    """Passes over a rollout."""
    gae_lambda: float = 0.95
    """Of generalized advantage estimation."""
    clip: float = 0.2
    """Of the probability ratio."""
    entropy: float = 0.0
    """Weight of the policy's entropy."""
    value_weight: float = 0.5
    """Weight of the value function's error."""
    log_deviation: float = -0.5
    """Logarithm of the actions' deviation at the start."""

    # sac and td3
    replay: int = 400_000
    """Steps that are remembered."""
    learning_starts: int = 20_000
    """Steps of random actions before learning."""
    gradients: int = 4
    """Gradients for each control step of the batch."""

    # A warm start
    imitate: str | None = None
    """A policy to begin as a copy of; what posse_baselines.load takes."""
    imitate_rounds: int = 8
    """Rounds of play and fit; in the first the expert drives, then more and more the copy."""

    advise: str | None = None
    """A scripted policy whose proposals the policy is given, and which its actions are added to."""

    # Looking after it
    evaluate_every: int = 1_000_000
    """Steps between two looks at validation worlds."""
    evaluate_worlds: int = 64
    """Validation worlds that the policy is chosen on."""
    beside: str | None = "ddcs-distributed"
    """A policy whose score on the same worlds is shown beside it."""
    checkpoint_every: int = 1_000_000
    """Steps that are lost at most when the training is killed."""
    threads: int = 1
    """Threads for torch. From one seed, results agree for one and the same number."""
    tensorboard: bool = True
    """Log for TensorBoard, if it is installed."""
    wandb: str | None = None
    """A Weights & Biases project to log to, if it is installed."""

    def __post_init__(self) -> None:
        _check(self)

    @property
    def scenarios(self) -> tuple[Scenario, ...]:
        """Every scenario and team size to train on, one each, messages and rewards set."""
        overrides: dict[str, Any] = {**self.overrides, "message_size": self.message_size}
        if self.advise is not None:
            overrides["message_size"] = load(self.advise).message_size
        if self.reward_weights:
            overrides["reward_weights"] = self.reward_weights
        found = []
        for name in self.scenario.split(","):
            for size in self.team_sizes or (None,):
                team = {} if size is None else {"num_trackers": size}
                found.append(get_scenario(name.strip(), **overrides, **team))
        return tuple(found)

    @property
    def on_policy(self) -> bool:
        """Whether the algorithm learns from its own latest rollout."""
        return self.algorithm in ("ppo", "mappo")

    @property
    def run_folder(self) -> Path:
        """Where everything is written."""
        name = f"{self.scenario.replace(',', '+')}-{self.algorithm}-{self.seed}"
        return self.folder or Path("runs/train") / name

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain values."""
        values = dataclasses.asdict(self)
        values["folder"] = None if self.folder is None else str(self.folder)
        return values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> TrainSettings:
        """Return the settings of :meth:`to_dict`.

        Raises:
            SettingsError: An unknown setting, or an impossible value.
        """
        known = {f.name for f in dataclasses.fields(cls)}
        for name in values:
            if name not in known:
                raise SettingsError(
                    f"unknown setting {name!r}; settings are: {', '.join(sorted(known))}"
                )
        fitted = dict(values)
        for name in ("hidden", "team_sizes"):
            if name in fitted:
                fitted[name] = tuple(fitted[name])
        if fitted.get("folder") is not None:
            fitted["folder"] = Path(fitted["folder"])
        return cls(**fitted)


def default_settings(
    scenario: str = "smart", algorithm: str = "ppo", *, own: bool = True
) -> TrainSettings:
    """Return the settings that a scenario is trained with unless told otherwise.

    They are kept in ``posse_training/defaults``, a file for each scenario; ``all.toml`` holds for
    every scenario. In each, the table ``all`` holds for every algorithm, the others for one.
    Without the scenario's ``own`` these are what holds for every scenario.

    Raises:
        SettingsError: An unknown algorithm, or a default that no training can have.
    """
    if algorithm not in ALGORITHMS:
        raise SettingsError(
            f"unknown algorithm {algorithm!r}; algorithms are: {', '.join(ALGORITHMS)}"
        )
    values: dict[str, Any] = {"scenario": scenario, "algorithm": algorithm}
    folder = resources.files("posse_training") / "defaults"
    name = "mixture" if "," in scenario else scenario
    for file in (folder / "all.toml", *([folder / f"{name}.toml"] if own else ())):
        if file.is_file():
            tables = tomllib.loads(file.read_text(encoding="utf-8"))
            for table in ("all", algorithm):
                values.update(tables.get(table, {}))
    return TrainSettings.from_dict(values)


def read_settings(path: Path) -> TrainSettings:
    """Return the settings that a run folder's ``settings.json`` holds.

    Raises:
        SettingsError: There is no such file, or it is damaged.
    """
    try:
        return TrainSettings.from_dict(json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        raise SettingsError(f"{path.parent} is no run folder: it has no {path.name}") from None
    except (OSError, TypeError, json.JSONDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path} is damaged: {error}") from error


_AT_LEAST: Final[dict[str, float]] = {
    "steps": 1, "seed": 0, "num_worlds": 1, "message_size": 0, "minibatch": 2, "rollout": 1,
    "epochs": 1, "replay": 1, "learning_starts": 0, "gradients": 1, "imitate_rounds": 1,
    "evaluate_every": 1, "evaluate_worlds": 1, "checkpoint_every": 1, "threads": 1,
    "learning_rate": 0, "final_learning_rate": 0, "entropy": 0, "value_weight": 0, "clip": 0,
}  # fmt: skip


def _check(s: TrainSettings) -> None:
    if s.algorithm not in ALGORITHMS:
        raise SettingsError(
            f"unknown algorithm {s.algorithm!r}; algorithms are: {', '.join(ALGORITHMS)}"
        )
    for name, least in _AT_LEAST.items():
        value = getattr(s, name)
        if not value >= least:
            raise SettingsError(f"{name}={value!r} must be at least {least:g}")
    for name in ("discount", "gae_lambda"):
        value = getattr(s, name)
        if not 0 <= value <= 1:
            raise SettingsError(f"{name}={value!r} must lie in [0, 1]")
    if not s.hidden or min(s.hidden) < 1:
        raise SettingsError(
            f"hidden={s.hidden!r} must name at least one layer, each at least 1 wide"
        )
    if s.imitate is not None and not s.on_policy:
        raise SettingsError(f"imitate={s.imitate!r} goes with ppo and mappo, not {s.algorithm}")
    parts = s.scenarios
    if s.num_worlds < len(parts):
        raise SettingsError(
            f"num_worlds={s.num_worlds} is less than one for each of {len(parts)} scenarios and "
            "team sizes"
        )
    if s.advise is not None and (s.imitate is not None or s.message_size):
        raise SettingsError(
            f"advise={s.advise!r} goes with neither imitate nor message_size: the policy begins as "
            "its adviser, whose messages go out"
        )
    layouts = {(p.sonar_beams, p.message_size) for p in parts}
    if len(layouts) > 1:
        raise SettingsError("scenarios that are trained on together need equal sonar_beams")
