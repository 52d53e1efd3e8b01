"""``posse record``: episodes of policies as a Minari data set for offline learning; needs the extra ``datasets``."""

from __future__ import annotations

import contextlib
import json
import re
import shlex
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import gymnasium
import numpy as np
import tyro

import posse
from posse import Batch, Scenario, get_scenario
from posse_baselines import Policy, PolicyError, load, rollout
from posse_training.errors import SettingsError, require
from posse_training.evaluation.evaluation import played_errors, progress_bar
from posse_training.files import locked
from posse_training.options import Worlds
from posse_training.provenance import commit

if TYPE_CHECKING:
    from minari import MinariDataset
    from minari.data_collector import EpisodeBuffer

__all__ = ["record_dataset"]

_RECORD: Final = ("observations", "actions", "rewards", "terms", "score", "terminated", "truncated")


def record_dataset(
    policies: str | Policy | Sequence[str | Policy],
    scenario: str = "smart",
    episodes: int = 1000,
    *,
    out: str | Path,
    name: str | None = None,
    seed: int = 7,
    split: str = "train",
    progress: bool = True,
    **overrides: Any,
) -> MinariDataset:
    """Record episodes of ``posse/Team-v0`` as a Minari data set, ``posse/SCENARIO/NAME-v0``.

    Episode i is world i of the seed, played by policy i mod their number: one policy makes an expert's data set,
    several one of mixed quality. Each episode's metadata says who played which world, and every metric; the data set's
    ``posse`` entry (JSON) holds all settings, versions, the commit and the seed. Infos are the score and the reward
    terms of each step. A recording that is killed leaves a folder ``.recording-...`` behind, and no data set.

    Args:
        policies: Policies, or what :func:`posse_baselines.load` takes.
        scenario: Name of a scenario.
        episodes: How many, at least one for each policy.
        out: Folder of Minari data sets, made if missing.
        name: Name of the data set; default: the policies', joined by ``-and-``.
        seed: Seed of the worlds.
        split: Split of the worlds.
        progress: Whether to show a bar.
        overrides: Settings of the scenario.

    Raises:
        MissingExtraError: Minari is not installed.
        SettingsError: Too few episodes, or a data set of this name in ``out``.
        RunFolderError: Another process records one of this name there.
        PolicyError: No policy, an unknown one, or one that does not fit the scenario.
        ScenarioError: An unknown scenario or split, an invalid setting or seed.
    """
    require("datasets", "minari", "h5py")
    import minari
    from minari.dataset.minari_storage import MinariStorage

    given = [policies] if isinstance(policies, str) or not isinstance(policies, Sequence) else policies
    players = [load(each) for each in given]
    if not players:
        raise PolicyError("no policies given: pass at least one")
    if episodes < len(players):
        raise SettingsError(f"episodes={episodes} must be at least {len(players)}, one a policy")
    base = get_scenario(scenario, **overrides)
    overrides["message_size"] = max(base.message_size, *(each.message_size for each in players))
    settings = get_scenario(scenario, **overrides)
    name = name or "-and-".join(each.name for each in players)
    called = f"posse/{scenario}/{re.sub(r'[^A-Za-z0-9_-]', '-', name)}-v0"
    folder = Path(out).resolve()  # Minari joins a relative one to itself
    partial = folder / f".recording-{called.replace('/', '-')}"
    with locked(partial), contextlib.ExitStack() as stack:
        stack.callback(shutil.rmtree, partial, ignore_errors=True)
        if (folder / called).exists():
            raise SettingsError(f"{folder / called} exists: remove it, or choose another name")
        where = {"seed": seed, "split": split}
        about = {
            "version": posse.__version__,
            "commit": commit(),
            "scenario": settings.to_dict(),
            **where,
            "policies": [{"name": each.name, "card": getattr(each, "card", None)} for each in players],
        }
        env = gymnasium.make("posse/Team-v0", scenario=scenario, split=split, **overrides)
        described = {
            "dataset_id": called,
            "author": {"posse"},
            "algorithm_name": name,
            "description": f"episodes of posse's scenario {scenario!r}, played by {name}",
            "requirements": [f"posse-rl=={posse.__version__}"],
            "minari_version": minari.__version__,
            "posse": json.dumps(about),
        }
        shutil.rmtree(partial / "new", ignore_errors=True)  # of a recording that was killed
        (data := partial / "new" / "data").mkdir(parents=True)
        storage = MinariStorage.new(data, env.observation_space, env.action_space, env.spec)
        storage.update_metadata(described)
        bar = stack.enter_context(progress_bar(disable=not progress))
        for world in bar.track(range(episodes), description="episodes"):
            buffer, metadata = _episode(players[world % len(players)], settings, world, where)
            storage.update_episodes([buffer])
            storage.update_episode_metadata([metadata], [world])
        (folder / called).parent.mkdir(parents=True, exist_ok=True)
        data.parent.rename(folder / called)
    return minari.MinariDataset(folder / called / "data")


def _episode(
    policy: Policy, settings: Scenario, world: int, where: dict[str, Any]
) -> tuple[EpisodeBuffer, dict[str, Any]]:
    """Play a world and return its buffer and metadata.

    Observations are (T + 1, N, F), actions (T, N, 2 + m), rewards (T,), the mean of the team's. Infos are ``score``
    (T + 1,) and ``reward``, each term by name (T + 1, N); those of the reset are 0.
    """
    from minari.data_collector import EpisodeBuffer

    batch = Batch(settings, 1, **where, first_world=world, autoreset="disabled", num_threads=1)
    with played_errors():
        played = rollout(batch, policy, _RECORD)
    terms = {name: np.insert(term[:, 0], 0, 0, axis=0) for name, term in played.named("reward").items()}
    buffer = EpisodeBuffer(
        id=world,
        seed=where["seed"],
        observations=played["observations"][:, 0],
        actions=played["actions"][:, 0],
        rewards=played["rewards"][:, 0].mean(axis=1, dtype=np.float64).tolist(),
        terminations=played["terminated"][:, 0].tolist(),
        truncations=played["truncated"][:, 0].tolist(),
        infos={"score": np.insert(played["score"][:, 0].astype(np.float64), 0, 0), "reward": terms},
    )
    metrics = {name: float(column[0]) for name, column in played.metrics.items()}
    return buffer, {"policy": policy.name, "world": world, **metrics}


@dataclass(frozen=True, kw_only=True)
class _Record(Worlds):
    """Record episodes as a Minari data set: of one policy, or of several in turn."""

    policies: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Policies: names, files, or package.module:Class."""
    episodes: int = 1000
    """How many."""
    out: Path = Path("runs/datasets")
    """Folder of Minari data sets; MINARI_DATASETS_PATH for those who load it."""
    name: str | None = None
    """Name of the data set; default: the policies'."""
    split: str = "train"
    """Split of the worlds: train, validation or test."""


def main(arguments: Sequence[str]) -> None:
    """Record, and print where the data set is and how it is loaded."""
    which = tyro.cli(_Record, prog="posse record", args=arguments)
    values = asdict(which)
    values |= values.pop("overrides")
    dataset = record_dataset(**values)
    print(
        f"{dataset.total_episodes} episodes, {dataset.total_steps:,} steps: "
        f"MINARI_DATASETS_PATH={shlex.quote(str(which.out))} and minari.load_dataset({dataset.spec.dataset_id!r})"
    )
