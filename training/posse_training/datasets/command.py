"""``posse record``: episodes of policies as a Minari data set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from posse_training.cluster.settings import RayOption, how_to_resume, of_option, work_of
from posse_training.errors import require


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
    ray: RayOption = None
    """Play on a Ray cluster, with the same result: --ray ADDRESS, or --ray alone for the cluster of
    this machine, or else all its cores. Interrupted, the same command resumes. Extra: cluster."""


def main(arguments: Sequence[str]) -> None:
    """Record, and print where the data set is and how it is loaded."""
    which = tyro.cli(_Record, prog="posse record", args=arguments)
    require("datasets", "minari", "h5py")
    from posse_training.datasets.record import record_dataset
    from posse_training.reports.evaluation import progress_bar

    cluster = of_option(which.ray, work_of(which.out))
    # With a cluster, its own bar is the one that counts.
    with how_to_resume(which.ray), progress_bar(disable=cluster is not None) as bar:
        task = bar.add_task("episodes", total=which.episodes)
        dataset = record_dataset(
            which.policies,
            which.scenario,
            which.episodes,
            out=which.out,
            name=which.name,
            seed=which.seed,
            split=which.split,
            progress=lambda count: bar.advance(task, count),
            ray=cluster or False,
        )
    print(
        f"{dataset.total_episodes} episodes, {dataset.total_steps:,} steps: "
        f"MINARI_DATASETS_PATH={which.out} and minari.load_dataset({dataset.spec.dataset_id!r})"
    )
