"""``posse watch``: one world in a window, or as a film."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro

from posse_training.errors import SettingsError

_SIZE: Final = (1280, 720)
_LEAST, _MOST = 200, 4096


@dataclass(frozen=True)
class _Watch:
    """Show policies in one world, in a window or as a film. Press H in the window for its keys."""

    policies: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Policies: names, files, or package.module:Class. The window shows the first and
    switches to the others (P); a film shows all side by side."""
    scenario: str = "smart"
    """Scenario to play."""
    target: str | None = None
    """Target: a motion, a learned target, a file or package.module:Class; default: the
    scenario's own."""
    seed: int = 7
    """Seed of the world."""
    world: int = 0
    """Index of the world."""
    split: str = "test"
    """Split of the world: train, validation or test."""
    num_trackers: int | None = None
    """Trackers in the team; default: the scenario's."""
    size: tuple[int, int] | None = None
    """Width and height of window or film, px; default: 1280 720 for a window."""
    film: Path | None = None
    """Write a film to this file (.gif or .mp4) instead of opening a window."""
    start: Annotated[float, tyro.conf.arg(name="from")] = 0.0
    """Simulated time at which a film begins, s."""
    seconds: float | None = None
    """Simulated time that a film shows, s; default: to the end of the episode."""
    speed: float | None = None
    """Simulated seconds per second of a film; default: 1.5."""


def main(arguments: Sequence[str]) -> None:
    """Show policies in one world."""
    which = tyro.cli(_Watch, prog="posse watch", args=arguments)
    from posse import get_scenario

    if not which.policies:
        raise SettingsError("No policies given. Pass at least one, such as ddcs-distributed.")
    scenario = get_scenario(which.scenario)
    if which.num_trackers is not None:
        scenario = scenario.replace(num_trackers=which.num_trackers)
    from posse_baselines import against, load, load_target

    target = None if which.target is None else load_target(which.target)
    if target is not None:
        scenario = target.fit(scenario)
    if which.film is not None:
        from posse_training.reports.pictures.film import film

        policies = [load(name) for name in which.policies]
        print(
            film(
                [(p.name, against(p, target)) for p in policies],
                scenario,
                path=which.film,
                seed=which.seed,
                world=which.world,
                split=which.split,
                start=which.start,
                seconds=scenario.duration if which.seconds is None else which.seconds,
                speed=1.5 if which.speed is None else which.speed,
                size=which.size,
            )
        )
        return
    given = {"--from": which.start or None, "--seconds": which.seconds, "--speed": which.speed}
    for option, value in given.items():
        if value is not None:
            raise SettingsError(f"{option} {value:g} is for films: add --film film.gif, or leave it out")
    size = which.size or _SIZE
    if not all(_LEAST <= side <= _MOST for side in size):
        raise SettingsError(f"--size {size[0]} {size[1]} must be {_LEAST} to {_MOST} px each")
    from posse_baselines import policy_names
    from posse_training.viewer.viewer import Viewer
    from posse_training.viewer.window import open_window, run, show

    others = [name for name in policy_names() if name not in which.policies]
    names = [*which.policies, *(others if len(which.policies) == 1 else [])]
    viewer = Viewer(
        names, scenario, target, seed=which.seed, world=which.world, split=which.split, size=size, show=show
    )
    command = f"posse watch {' '.join(which.policies)} --scenario {which.scenario}"
    if which.target is not None:
        command += f" --target {which.target}"
    open_window(size, f"posse: {scenario.name}", f"write a film: {command} --film film.gif")
    run(viewer)
    moment = viewer.moment
    print(f"{viewer.tape.name}: score {moment.scene.score:.3f} after {moment.scene.time:.1f} s")
