"""``posse watch``: one world in a window, or as a film."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from posse_training.errors import SettingsError


@dataclass(frozen=True)
class _Watch:
    """Show a policy in one world, in a window or as a film."""

    policy: Annotated[str, tyro.conf.Positional]
    """Policy: a name, a file, or package.module:Class."""
    scenario: str = "smart"
    """Scenario to play."""
    seed: int = 7
    """Seed of the world."""
    world: int = 0
    """Index of the world."""
    split: str = "test"
    """Split of the world: train, validation or test."""
    num_trackers: int | None = None
    """Trackers in the team; default: the scenario's."""
    gif: Path | None = None
    """Write a film to this file instead of opening a window."""


def main(arguments: Sequence[str]) -> None:
    """Show a policy in one world."""
    which = tyro.cli(_Watch, prog="posse watch", args=arguments)
    from posse import Batch, get_scenario
    from posse.rendering.renderer import Renderer
    from posse_baselines import begin, load

    policy = load(which.policy)
    overrides = {} if which.num_trackers is None else {"num_trackers": which.num_trackers}
    scenario = get_scenario(which.scenario, **overrides)
    if which.gif is not None:
        from posse_training.reports.pictures.film import film

        print(
            film(
                [(policy.name, policy)], scenario, path=which.gif, seed=which.seed,
                world=which.world, split=which.split, seconds=scenario.duration,
            )
        )  # fmt: skip
        return
    longest = max(scenario.message_size, policy.message_size)
    settings = scenario.replace(message_size=longest)
    batch = Batch(settings, 1, seed=which.seed, split=which.split, first_world=which.world)
    memory, observations = begin(policy, batch), batch.reset()
    renderer = Renderer(settings, mode="human", title=policy.name)
    for _ in range(settings.horizon):
        actions, memory = policy.act(observations, memory)
        observations, *_ = batch.step(actions)
        try:
            renderer.draw(batch, annotations=policy.annotations(memory))
        except RuntimeError as error:  # no window can be opened
            raise SettingsError(f"{error}; or write a film: --gif film.gif") from error
        if renderer.closed:
            break
    renderer.close()
    print(f"score {batch.metrics()['score'][0]:.3f} after {batch.worlds['step'][0]} steps")
