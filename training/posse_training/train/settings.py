"""The settings of a training run: one typed, frozen class; :mod:`posse_training.train.presets` has its defaults."""

import dataclasses
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self

import tyro

from posse import Family, Scenario, ScenarioError
from posse.declarations import Declarations
from posse.scenarios.family import blocks, scenario_or_family
from posse_baselines import PolicyError, load
from posse_baselines.ddcs.monitoring import MESSAGE_SIZE
from posse_baselines.fields import number
from posse_baselines.files import read_json
from posse_baselines.policies.scripted import SCRIPTED
from posse_training.errors import SettingsError, check_settings
from posse_training.options import Changes, MaybeNames, Names, Pairs
from posse_training.provenance import digests

Point = dict[str, float]
"""Of a learning curve, by the columns of ``curve.csv``: agent steps, s, mean safe score and its 95 % interval, mean
score, share of episodes without contact."""

SETTINGS: Final = "settings.json"
BEST: Final = "best.safetensors"
LAST: Final = "last.safetensors"
CURVE: Final = "curve.csv"
"""Files of a run folder; the checkpoint is one more."""
FREE: Final = ("steps", "tensorboard", "wandb")
"""Settings that the command that resumes a run may change."""


@dataclass(frozen=True, kw_only=True)
class TrainSettings:
    """Settings of a training run; the defaults depend on scenario and algorithm.

    A *step* is one control step of one tracker.

    Raises:
        SettingsError: A value out of its range; the message names it, the range and the fix.
    """

    scenario: Names = "smart"
    """Scenario to train on, or several (in Python one text with commas)."""
    algorithm: str = "ppo"
    """ppo, mappo (ppo with a value function that reads the state of the world), sac, td3, or cmaes (evolution of a
    linear policy, or of a linear correction of a script)."""
    steps: int = number(20_000_000, "", 1, 10**12)
    """Steps to train for, at least; rollouts are completed."""
    seed: int = number(1, "", 0, 2**32 - 1)
    """Seed of the worlds, the networks and the exploration."""
    folder: Annotated[Path | None, tyro.conf.arg(name="out")] = None
    """Run folder; default: runs/train/SCENARIO-ALGORITHM-SEED."""

    # The sides
    side: Literal["trackers", "target"] = "trackers"
    """What learns: the trackers, or the target."""
    target: MaybeNames = None
    """Targets that the trackers play against where these learn: names, files or package.module:Class (in Python
    one text with commas). The worlds are divided evenly among them; a name twice gets two shares. Default: the
    scenario's own target."""
    team: MaybeNames = None
    """Teams that a target plays against where it learns, likewise."""
    start: str | None = None
    """Run folder whose networks and input statistics the run begins with."""

    # The worlds
    num_worlds: int = number(256, "", 1, 10**6)
    """Worlds stepped together, over all scenarios and team sizes."""
    family_scenarios: int = number(32, "", 1, 10**5)
    """Drawn scenarios of a family that are trained on, each in a share of the worlds."""
    team_sizes: tuple[int, ...] = ()
    """Numbers of trackers to train with; default: the scenario's own."""
    num_neighbours: int | None = number(None, "", 0, 4096)
    """Team-mates that the policy reads, nearest first; default: as many as are observed."""
    message_size: int = number(0, "", 0, 64 - MESSAGE_SIZE)
    """Numbers that a tracker adds to its broadcast in each step; where poses drift, the safeguard adds five more."""
    overrides: Changes = field(default_factory=dict)
    """Settings of the scenario to change, such as target_speed=0.5 or arena=6,4."""
    reward_weights: Pairs = field(default_factory=dict)
    """Weight of each reward term, such as slot=0.2; those that are not named keep their defaults."""

    end_on_contact: bool = False
    """A contact ends the training episode, so that the return of the rewards that follow is lost, as it is of the
    safe score. Evaluations go on."""
    safeguard: bool = False
    """The action is a wanted velocity, which the safeguard of the script carries out."""

    # The networks
    encoding: Literal["plain", "features"] = "features"
    """Network inputs: the observation, or with features computed from it."""
    hidden: tuple[int, ...] = (64, 64)
    """Widths of the hidden layers of policy and value function."""
    activation: Literal["tanh", "relu"] = "tanh"
    """Activation between the layers."""

    # All algorithms
    learning_rate: float = number(3e-4, "", 0, 10)
    """Learning rate at the start."""
    final_learning_rate: float = number(3e-5, "", 0, 10)
    """Learning rate at the end; it falls linearly in between."""
    discount: float = number(0.99, "", 0, 1)
    """Discount of rewards for each control step, γ."""
    minibatch: int = number(8192, "", 2, 10**9)
    """Steps in one gradient, about: a rollout is divided evenly."""

    # ppo and mappo
    rollout: int = number(64, "", 1, 10**6)
    """Control steps between two updates."""
    epochs: int = number(4, "", 1, 1000)
    """Passes over a rollout."""
    gae_lambda: float = number(0.95, "", 0, 1)
    """λ of generalized advantage estimation."""
    clip: float = number(0.2, "", 0, 100)
    """Largest change of the probability ratio in an update."""
    entropy: float = number(0.0, "", 0, 1000)
    """Weight of the policy's entropy."""
    value_weight: float = number(0.5, "", 0, 1000)
    """Weight of the value function's error."""
    log_deviation: float = number(-0.5, "", -20, 5)
    """Logarithm of the actions' standard deviation at the start."""
    final_log_deviation: float | None = number(None, "", -20, 5)
    """Upper limit of that logarithm at the end; it falls linearly. Default: no limit."""

    # sac and td3
    replay: int = number(400_000, "", 1, 10**9)
    """Steps in the replay buffer, rounded to whole steps of all worlds."""
    learning_starts: int = number(20_000, "", 0, 10**12)
    """Steps of random actions before learning starts."""
    gradients: int = number(4, "", 1, 10**4)
    """Gradient steps for each control step of the batch."""

    # cmaes; num_worlds is the number that each candidate plays, for whole episodes
    advise: str | None = None
    """Scripted policy that is corrected: the network reads the velocity that it wants, and adds to it."""
    population: int = number(32, "", 4, 1000)
    """Candidates in a generation."""
    deviation: float = number(0.1, "", 1e-6, 10)
    """Standard deviation of the weights at the start."""

    # A warm start
    imitate: str | None = None
    """Policy to copy first: a name, file or package.module:Class; behind the safeguard the DDCS or belief-planner."""
    imitate_rounds: int = number(8, "", 1, 1000)
    """Rounds of play and fit; the copy acts in a growing share of the worlds."""

    # Evaluation, checkpoints and logs
    evaluate_every: int = number(1_000_000, "", 1, 10**15)
    """Steps between two evaluations on validation worlds."""
    evaluate_worlds: int = number(64, "", 1, 10**6)
    """Validation worlds of each scenario; the best policy on them is kept."""
    beside: str | None = "ddcs-tuned"
    """Policy whose safe score on the same worlds is shown for comparison."""
    checkpoint_every: int = number(1_000_000, "", 1, 10**15)
    """Steps between two checkpoints: a killed run loses at most these."""
    threads: int = number(1, "", 1, 1024)
    """Threads for torch; results are reproducible for the same number."""
    tensorboard: bool = True
    """Write TensorBoard logs, if it is installed."""
    wandb: str | None = None
    """Weights & Biases project to log to; needs the package wandb."""

    def __post_init__(self) -> None:
        check_settings(self)
        for message in _conflicts(self):
            raise SettingsError(message)

    @property
    def given(self) -> tuple[Scenario | Family, ...]:
        """Every scenario or family and team size, with messages and reward weights set."""
        overrides: dict[str, Any] = {**self.overrides, "message_size": self.message_size}
        if self.advise is not None:
            overrides["message_size"] = load(self.advise).message_size
        if self.reward_weights:
            weights = "target_reward_weights" if self.side == "target" else "reward_weights"
            overrides[weights] = self.reward_weights
        sizes: list[dict[str, Any]] = [{"num_trackers": size} for size in self.team_sizes] or [{}]
        names = self.scenario.split(",")
        made = tuple(scenario_or_family(name.strip(), **overrides, **size) for name in names for size in sizes)
        if self.safeguard and any(next(blocks(each, range(1), 0, "train"))[0].drifts for each in made):
            made = tuple(each.replace(message_size=self.message_size + MESSAGE_SIZE) for each in made)
        return made

    @property
    def opponents(self) -> dict[str, int]:
        """What the side that learns plays against, and how often each is named; empty: the scenario's own target."""
        named = self.team if self.side == "target" else self.target
        return dict(Counter(name.strip() for name in named.split(",")) if named else {})

    @property
    def run_folder(self) -> Path:
        """The folder that the run is written to."""
        return self.folder or Path("runs/train") / self.name

    @property
    def name(self) -> str:
        """The name of the run and of its policies."""
        side = "-target" if self.side == "target" else ""
        return f"{self.scenario.replace(',', '+')}{side}-{self.algorithm}-{self.seed}"

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain values, without the folder."""
        return {**dataclasses.asdict(self), "folder": None}

    def held(self) -> dict[str, Any]:
        """Return what must be the same when a run is resumed: settings, versions and digests of code that it uses."""
        bases = [each.base if isinstance(each, Family) else each for each in self.given]
        rules = {f"{name}:rules" for base in bases for name in Declarations.of(base).modules}
        return {**self.to_dict(), "versions": [base.version for base in bases], **digests([*self.opponents, *rules])}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Return the settings of :meth:`to_dict`; SettingsError for an unknown or invalid one."""
        fitted = {name: value for name, value in values.items() if not name.startswith(("versions", "digest of "))}
        known = {f.name for f in dataclasses.fields(cls)}
        for name in fitted:
            if name not in known:
                raise SettingsError(f"unknown setting {name!r:.80}; settings are: {', '.join(sorted(known))}")
        for name in ("hidden", "team_sizes"):
            if isinstance(fitted.get(name), list):
                fitted[name] = tuple(fitted[name])
        if isinstance(fitted.get("folder"), str):
            fitted["folder"] = Path(fitted["folder"])
        return cls(**fitted)


def _conflicts(s: TrainSettings) -> Iterator[str]:
    """Yield what is wrong with settings beyond what each declares, and why valid ones exclude each other."""
    for name in ("overrides", "reward_weights"):
        if not isinstance(value := getattr(s, name), dict):
            yield f"{name}={value!r:.80} is invalid: it must map names to values"
    if s.advise is not None and s.advise not in SCRIPTED:  # settings that are read run no code
        yield f"advise={s.advise!r:.80} is no script of the package, such as ddcs-tuned"
    for name in ("hidden", "team_sizes"):
        value = getattr(s, name)
        if not isinstance(value, tuple) or not all(type(size) is int and size >= 1 for size in value):
            yield f"{name}={value!r:.80} is invalid: it must be whole numbers of at least 1, such as 64,64"
    if s.final_log_deviation is not None and s.final_log_deviation > s.log_deviation:
        yield f"final_log_deviation={s.final_log_deviation} must not exceed log_deviation={s.log_deviation}: lower it"
    own, other = ("target", "team") if s.side == "target" else ("team", "target")
    if getattr(s, own) is not None:
        yield (
            f"{own}={getattr(s, own)!r:.80} is of the side that learns, side={s.side!r}: name what it plays against "
            f"by {other}, or change side"
        )
    if s.side == "target":
        if s.team is None:
            yield "side='target' needs the teams that chase it: set team, for example to ddcs-tuned"
        for name, needed in _OF_A_TARGET.items():
            if (value := getattr(s, name)) != needed:
                yield f"side='target' needs {name}={needed!r}, not {value!r}: a target has no team, slots or messages"
    for name, instead in _ELSEWHERE.items():
        if name in s.overrides and (name != "num_trackers" or s.team_sizes):
            yield f"overrides cannot set {name!r}: use {instead} instead"
    bases = [given.base if isinstance(given, Family) else given for given in s.given]
    if len({base.sonar_beams for base in bases}) > 1:
        yield "scenarios that are trained on together need equal sonar_beams: set it in overrides"


_OF_A_TARGET = {"imitate": None, "advise": None, "message_size": 0, "encoding": "plain", "safeguard": False}
_ELSEWHERE = {
    "name": "the setting scenario",
    "message_size": "the setting message_size",
    "reward_weights": "the setting reward_weights",
    "target_reward_weights": "the setting reward_weights with side target",
    "target_motion": "the setting target",
    "num_trackers": "the setting team_sizes",
}


def read_settings(path: Path) -> TrainSettings:
    """Return the settings of a run folder's ``settings.json``; SettingsError if it is missing or damaged."""
    try:
        return TrainSettings.from_dict(read_json(path))
    except FileNotFoundError:
        raise SettingsError(f"{path.parent} is not a run folder: it has no {path.name}") from None
    except (SettingsError, ScenarioError, PolicyError):
        raise
    except (AttributeError, OSError, TypeError, ValueError) as error:
        raise SettingsError(f"{path} is damaged: {error}") from error
