"""The command line: ``posse train | compare | watch | replay | ship | ...``.

Each command imports what it needs when it is called: listing the scenarios does not wait for torch.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import tyro


@dataclass(frozen=True)
class _Command:
    """A command: what it does in a line, and the function that takes its arguments."""

    summary: str
    module: str
    function: str


_REPORTS: Final = "posse_training.reports"
COMMANDS: Final[dict[str, _Command]] = {
    "train": _Command("train a team", __name__, "train"),
    "compare": _Command("score policies on the same worlds", f"{_REPORTS}.compare", "main"),
    "watch": _Command("see a policy at work, or film it", __name__, "watch"),
    "replay": _Command(
        "write teams at work as a web page", "posse_training.replay.command", "main"
    ),
    "ship": _Command("make runs a policy that comes along", "posse_training.runs.ship", "main"),
    "reproduce": _Command("redo the paper's experiments", f"{_REPORTS}.reproduce", "main"),
    "scenarios": _Command("list the scenarios", __name__, "scenarios"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return the exit status: 0, or 2 after an error that the user can mend."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] in ("-h", "--help"):
        print(_usage())
        return 0
    if given[0] == "--version":
        print(f"posse {importlib.import_module('posse').__version__}")
        return 0
    name, rest = given[0], given[1:]
    if name not in COMMANDS:
        print(f"posse: unknown command {name!r}\n\n{_usage()}", file=sys.stderr)
        return 2
    command = COMMANDS[name]
    module = sys.modules[__name__]
    if command.module != __name__:
        module = importlib.import_module(command.module)
    run: Callable[[list[str]], Any] = getattr(module, command.function)
    try:
        run(rest)
    except _mendable() as error:
        print(f"posse {name}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"\nposse {name}: stopped", file=sys.stderr)
        return 130
    return 0


def _usage() -> str:
    lines = [f"  {name:<11} {command.summary}" for name, command in COMMANDS.items()]
    return "\n".join(["usage: posse COMMAND ...", "", *lines, "", "posse COMMAND --help says more"])


def _mendable() -> tuple[type[Exception], ...]:
    """Return the errors whose message is for the user; all others keep their traceback."""
    found: list[type[Exception]] = []
    for module, names in (
        ("posse.scenarios", ("ScenarioError",)),
        ("posse_baselines.policy", ("PolicyError",)),
        ("posse_training.reports.evaluation", ("TrainedSplitError",)),
        ("posse_training.runs.settings", ("SettingsError",)),
        ("posse_training.runs.checkpoint", ("RunFolderError", "CheckpointError")),
    ):
        if module in sys.modules:  # what was never imported was never raised
            found += [getattr(sys.modules[module], name) for name in names]
    return tuple(found)


# --- posse train ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Which:
    """What the defaults of all other settings depend on."""

    scenario: str = "smart"
    algorithm: str = "ppo"


@dataclass(frozen=True)
class _Resume:
    """Go on with a training."""

    resume: Path
    """Its run folder."""
    steps: int | None = None
    """Train for so many steps in all, instead of what the run was begun with."""


def train(arguments: list[str]) -> None:
    """Train a team, or go on with a training: ``posse train --resume DIR``."""
    if any(a == "--resume" or a.startswith("--resume=") for a in arguments):
        from posse_training.runs.train import resume

        which = tyro.cli(_Resume, prog="posse train", args=arguments)
        with _way_back(which.resume):
            print(resume(which.resume, steps=which.steps))
        return
    from posse_training.runs.settings import TrainSettings, default_settings

    asked = [a for a in arguments if a not in ("-h", "--help")]
    some, _ = tyro.cli(_Which, args=asked, return_unknown_args=True)
    default = default_settings(some.scenario, some.algorithm)
    settings = tyro.cli(
        TrainSettings,
        prog="posse train",
        description="Train a team. Go on with a training: posse train --resume DIR",
        default=default,
        args=arguments,
    )
    from posse_training.runs.train import train as run

    with _way_back(settings.run_folder):
        print(run(settings))


@contextmanager
def _way_back(folder: Path) -> Iterator[None]:
    """Say to who stops a training how to go on with it."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"\nto go on: posse train --resume {folder}", file=sys.stderr)
        raise


# --- posse watch ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Watch:
    """See a policy at work in one world, in a window or as a film."""

    policy: Annotated[str, tyro.conf.Positional]
    """A policy's name, a file, or "package.module:Class"."""
    scenario: str = "smart"
    """What to play."""
    seed: int = 7
    """Of the world."""
    world: int = 0
    """Which world of the seed."""
    split: str = "test"
    """Of which split."""
    num_trackers: int | None = None
    """Trackers in the team; default: the scenario's."""
    gif: Path | None = None
    """Write a film here instead of opening a window."""


def watch(arguments: list[str]) -> None:
    """Show a policy at work."""
    which = tyro.cli(_Watch, prog="posse watch", args=arguments)
    from posse import Batch, get_scenario
    from posse.rendering.renderer import Renderer
    from posse_baselines import begin, load

    policy = load(which.policy)
    overrides = {} if which.num_trackers is None else {"num_trackers": which.num_trackers}
    scenario = get_scenario(which.scenario, **overrides)
    if which.gif is not None:
        from posse_training.reports.film import film

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
    renderer = Renderer(settings, mode="human", title=policy.name)
    memory, observations = begin(policy, batch), batch.reset()
    for _ in range(settings.horizon):
        actions, memory = policy.act(observations, memory)
        observations, *_ = batch.step(actions)
        renderer.draw(batch, annotations=policy.annotations(memory))
        if renderer.closed:
            break
    renderer.close()
    print(f"score {batch.metrics()['score'][0]:.3f} after {batch.worlds['step'][0]} steps")


# --- posse scenarios ------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Scenarios:
    """List the scenarios, or every setting of one."""

    name: Annotated[str | None, tyro.conf.Positional] = None
    """A scenario, to see its settings."""


def scenarios(arguments: list[str]) -> None:
    """List the scenarios with what tells them from the plainest one, or all settings of one."""
    which = tyro.cli(_Scenarios, prog="posse scenarios", args=arguments)
    from rich.console import Console
    from rich.table import Table

    from posse import get_scenario, scenario_names

    table = Table(box=None, pad_edge=False)
    if which.name is not None:
        scenario = get_scenario(which.name)
        table.add_column("setting", style="bold")
        table.add_column("value")
        for name, value in scenario.to_dict().items():
            table.add_row(name, str(value))
    else:
        plain = get_scenario("constant").to_dict()
        table.add_column("scenario", style="bold", no_wrap=True)
        table.add_column("settings that differ from those of constant")
        for name in scenario_names():
            values = get_scenario(name).to_dict()
            differs = [
                f"{key}={value}"
                for key, value in values.items()
                if value != plain[key] and key != "name"
            ]
            table.add_row(name, ", ".join(differs) or "-")
    Console().print(table)


if __name__ == "__main__":
    sys.exit(main())
