"""``posse record``: episodes of policies as a Minari data set for offline learning; needs the extra ``datasets``."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import re
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import gymnasium
import numpy as np
import tyro

import posse
from posse import Batch, Scenario, get_scenario
from posse_baselines import Policy, PolicyError, begin, load
from posse_training.errors import SettingsError, require
from posse_training.evaluation.evaluation import progress_bar
from posse_training.provenance import commit

if TYPE_CHECKING:
    from minari import MinariDataset
    from minari.data_collector import EpisodeBuffer

__all__ = ["load_dataset", "record_dataset"]

AT_ONCE: Final = 20
"""Episodes in memory at a time: some 20 MB for five trackers."""
_PATH: Final = "MINARI_DATASETS_PATH"


def record_dataset(
    policies: str | Policy | Sequence[str | Policy],
    scenario: str = "smart",
    episodes: int = 1000,
    *,
    out: str | Path,
    name: str | None = None,
    seed: int = 7,
    split: str = "train",
    progress: Callable[[int], object] = lambda episodes: None,
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
        progress: Called with the number of episodes that have been written since the last call.
        overrides: Settings of the scenario.

    Raises:
        MissingExtraError: Minari is not installed.
        SettingsError: Too few episodes, or a data set of this name in ``out``.
        PolicyError: No policy, an unknown one, or one that does not fit the scenario.
        ScenarioError: An unknown scenario or split, an invalid setting or seed.
    """
    require("datasets", "minari", "h5py")
    given = [policies] if isinstance(policies, str) or not isinstance(policies, Sequence) else policies
    players = [load(each) if isinstance(each, str) else each for each in given]
    if not players:
        raise PolicyError("no policies given: pass at least one")
    if episodes < len(players):
        raise SettingsError(f"episodes={episodes} must be at least {len(players)}, one a policy")
    base = get_scenario(scenario, **overrides)
    overrides["message_size"] = max(base.message_size, *(each.message_size for each in players))
    settings = get_scenario(scenario, **overrides)
    name = name or "-and-".join(each.name for each in players)
    called = f"posse/{scenario}/{re.sub(r'[^A-Za-z0-9_.-]', '-', name)}-v0"
    folder = Path(out)
    if (folder / called).exists():
        raise SettingsError(f"{folder / called} exists: remove it, or choose another name")
    about = {
        "version": posse.__version__,
        "commit": commit(),
        "scenario": settings.to_dict(),
        "seed": seed,
        "split": split,
        "policies": [{"name": each.name, "card": getattr(each, "card", None)} for each in players],
    }
    env = gymnasium.make("posse/Team-v0", scenario=scenario, split=split, **overrides)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".recording-", dir=folder) as partial:
        _write(Path(partial), called, env, _played(players, settings, episodes, seed, split), progress, name, about)
        (folder / called).parent.mkdir(parents=True, exist_ok=True)
        Path(partial, called).rename(folder / called)
    return load_dataset(folder, called)


def load_dataset(out: str | Path, name: str) -> MinariDataset:
    """Return a data set of a folder by its name, ``posse/SCENARIO/NAME-v0``.

    Raises:
        MissingExtraError: Minari is not installed.
        FileNotFoundError: There is none of this name.
    """
    require("datasets", "minari", "h5py")
    import minari

    with _datasets_in(Path(out)):
        return minari.load_dataset(name)


def _played(
    players: Sequence[Policy], settings: Scenario, episodes: int, seed: int, split: str
) -> Iterator[tuple[EpisodeBuffer, dict[str, Any]]]:
    """Play world after world; yield each episode's buffer and metadata.

    Observations are (T + 1, N, F), actions (T, N, 2 + m), rewards (T,), the mean of the team's. Infos are ``score``
    (T + 1,) and ``reward_terms``, each (T + 1, N); those of the reset are 0.
    """
    from minari.data_collector import EpisodeBuffer

    for world in range(episodes):
        policy = players[world % len(players)]
        batch = Batch(settings, 1, seed=seed, split=split, first_world=world, autoreset="disabled", num_threads=1)
        memory, seen = begin(policy, batch), batch.reset()
        observations, actions, rewards, scores = [seen[0]], [], [], [0.0]
        terms = {name: [np.zeros(settings.num_trackers, np.float32)] for name in batch.term_names}
        ended = False
        while not ended:
            acted, memory = policy.act(seen, memory)
            seen, gained, terminated, truncated, infos = batch.step(acted)
            ended = bool(terminated[0] or truncated[0])
            observations.append(seen[0])
            actions.append(np.array(acted[0], np.float32))
            rewards.append(float(gained[0].mean(dtype=np.float64)))
            scores.append(float(infos["score"][0]))
            for name, column in terms.items():
                column.append(np.array(infos[f"reward/{name}"][0]))
        ends = np.arange(len(actions)) == len(actions) - 1
        buffer = EpisodeBuffer(
            id=world,
            seed=seed,
            observations=np.stack(observations),
            actions=np.stack(actions),
            rewards=rewards,
            terminations=(ends & terminated[0]).tolist(),
            truncations=(ends & ~terminated[0]).tolist(),
            infos={"score": np.array(scores), "reward": {name: np.stack(column) for name, column in terms.items()}},
        )
        metrics = {name: float(infos[f"metrics/{name}"][0]) for name in batch.metrics()}
        yield buffer, {"policy": policy.name, "world": world, **metrics}


def _write(
    folder: Path,
    called: str,
    env: gymnasium.Env[Any, Any],
    played: Iterator[tuple[EpisodeBuffer, dict[str, Any]]],
    progress: Callable[[int], object],
    name: str,
    about: dict[str, Any],
) -> None:
    """Write a data set, ``AT_ONCE`` episodes at a time."""
    import minari

    dataset: MinariDataset | None = None
    done = 0
    with _datasets_in(folder), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that an e-mail address is missing
        while part := list(itertools.islice(played, AT_ONCE)):
            buffers, metadata = (list(each) for each in zip(*part, strict=True))
            if dataset is None:
                dataset = minari.create_dataset_from_buffers(
                    called,
                    buffers,
                    env=env,
                    data_format="hdf5",
                    author="posse",
                    requirements=[f"posse=={posse.__version__}"],
                    description=f"episodes of posse's scenario {about['scenario']['name']!r}, played by {name}",
                    algorithm_name=name,
                    code_permalink=f"posse {posse.__version__} {about['commit'] or ''}",
                )
                dataset.storage.update_metadata({"posse": json.dumps(about)})
            else:
                dataset.storage.update_episodes(buffers)
            dataset.storage.update_episode_metadata(metadata, range(done, done + len(part)))
            done += len(part)
            progress(len(part))


@contextlib.contextmanager
def _datasets_in(folder: Path) -> Iterator[None]:
    """Let Minari keep its data sets in a folder meanwhile."""
    folder.mkdir(parents=True, exist_ok=True)
    before = os.environ.get(_PATH)
    os.environ[_PATH] = str(folder.resolve())
    try:
        yield
    finally:
        if before is None:
            del os.environ[_PATH]
        else:
            os.environ[_PATH] = before


@dataclass(frozen=True)
class _Record:
    """Record episodes as a Minari data set: of one policy, or of several in turn."""

    policies: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Policies: names, files, or package.module:Class."""
    scenario: str = "smart"
    """Scenario to play."""
    episodes: int = 1000
    """How many."""
    out: Path = Path("runs/datasets")
    """Folder of Minari data sets; MINARI_DATASETS_PATH for those who load it."""
    name: str | None = None
    """Name of the data set; default: the policies'."""
    seed: int = 7
    """Seed of the worlds."""
    split: str = "train"
    """Split of the worlds: train, validation or test."""


def main(arguments: Sequence[str]) -> None:
    """Record, and print where the data set is and how it is loaded."""
    which = tyro.cli(_Record, prog="posse record", args=arguments)
    with progress_bar() as bar:
        task = bar.add_task("episodes", total=which.episodes)
        dataset = record_dataset(**asdict(which), progress=lambda count: bar.advance(task, count))
    print(
        f"{dataset.total_episodes} episodes, {dataset.total_steps:,} steps: "
        f"MINARI_DATASETS_PATH={which.out} and minari.load_dataset({dataset.spec.dataset_id!r})"
    )
