"""``posse watch``: one world in a window, as a replay page, or as a film."""

import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import tyro

from posse import Scenario, get_scenario
from posse_baselines import Policy, load, load_target
from posse_training.errors import SettingsError
from posse_training.evaluation.episodes import refuse_two_targets
from posse_training.film import Team, film
from posse_training.options import Shown
from posse_training.play import open_window
from posse_training.replay import record, write_replay

_PAGE: Final = Path("runs/watch/replay.html")


@dataclass(frozen=True, kw_only=True)
class _Watch(Shown):
    """Show policies in one world: live in a window, as a replay page, or as a film.

    The window shows one policy at a time; a page or a film all side by side. Keys of the window: Space pauses and goes
    on, S steps, - and + change the speed, N goes to the next world, P to the next policy, Q or Esc closes it.
    """

    page: bool = False
    """Record the world and open its replay page (runs/watch/replay.html) in the browser, instead of a window."""
    out: Path | None = None
    """Write a film to this file (.gif or .mp4; an old one is replaced) instead of opening a window."""
    size: tuple[int, int] | None = None
    """Width and height of window or film, px; default: 960 720 for a window."""
    start: Annotated[float | None, tyro.conf.arg(name="from")] = None
    """Simulated time at which a film begins, s; default: 0."""
    speed: float | None = None
    """Simulated seconds per second of a film; default: 1.5."""


def main(arguments: Sequence[str]) -> None:
    """Show policies in one world."""
    which = tyro.cli(_Watch, prog="posse watch", args=arguments)
    if not which.policies:
        raise SettingsError("No policies given. Pass at least one, such as ddcs-distributed.")
    if which.page and which.out is not None:
        raise SettingsError(f"--page and --out {which.out} exclude each other: leave one out")
    is_film = which.out is not None
    for option, value, is_used in (
        ("--from", which.start, is_film),
        ("--speed", which.speed, is_film),
        ("--seconds", which.seconds, is_film or which.page),
        ("--size", which.size, not which.page),
    ):
        if value is not None and not is_used:
            raise SettingsError(f"{option} is not for a {'page' if which.page else 'window'}: leave it out")
    scenario = get_scenario(which.scenario, **which.overrides)
    refuse_two_targets(which.target, which.overrides)
    target = None if which.target is None else load_target(which.target)
    if target is not None:
        scenario = scenario.replace(target_motion=target.motion)
    policies = [load(name) for name in which.policies]
    world = {**which.place, "target": target}
    if which.out is not None:
        asked = {"start": which.start, "seconds": which.seconds, "speed": which.speed, "size": which.size}
        how: Any = {"seconds": scenario.duration} | {name: value for name, value in asked.items() if value is not None}
        print(film([(p.name, p) for p in policies], scenario, path=which.out, **how, **world))
    elif which.page:
        _PAGE.parent.mkdir(parents=True, exist_ok=True)
        path = write_replay(record(policies, scenario, seconds=which.seconds, **world), _PAGE)
        print(f"{path}: open it in a browser")
        webbrowser.open(path.resolve().as_uri())
    else:
        watch(policies, scenario, which.size or (960, 720), **world)


def watch(policies: Sequence[Policy], scenario: Scenario, size: tuple[int, int], world: int, **worlds: Any) -> None:
    """Play one policy at a time in a window, until the user closes it; each ended episode prints its score."""
    shown, keys = 0, {"n": "next world"} | ({"p": "next policy"} if len(policies) > 1 else {})
    longest = max(scenario.message_size, *(policy.message_size for policy in policies))
    scenario = scenario.replace(message_size=longest)  # a window shows batches of one scenario
    Team(policies[0], scenario, world=world, **worlds).step()  # compiles what is needed before the window opens
    renderer, window = open_window(scenario, size, keys)
    try:
        while renderer.window:
            team = Team(policies[shown], scenario, world=world, **worlds)
            renderer.title = f"{team.policy.name}, world {world}"
            renderer.draw(team.batch)
            while renderer.window and not (team.over or window.pressed & keys.keys()):  # type: ignore[truthy-bool]
                team.step()
                window.paused |= team.over  # the last moment stays until a key is pressed
                renderer.draw(team.batch, colours=team.colours)
            if steps := len(team.scores):
                time, score = steps * scenario.control_step, sum(team.scores) / steps
                print(f"world {world}, {team.policy.name}: score {score:.3f} after {time:.1f} s", flush=True)
            if "p" in window.pressed & keys.keys():
                shown = (shown + 1) % len(policies)
            else:
                world += 1
    finally:
        renderer.close()
