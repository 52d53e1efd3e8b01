"""``posse play``: drive the target against a team, or one tracker in it, by the arrow keys."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import tyro

from posse import Batch, Scenario, get_scenario
from posse.rendering.canvas import Window
from posse.rendering.renderer import Renderer
from posse.rendering.style import TRACKER
from posse_baselines import Policy, PolicyError, Recorder, begin, load
from posse_training.errors import SettingsError
from posse_training.evaluation.evaluation import played_errors
from posse_training.options import OneWorld
from posse_training.replay import RECORD, Replay, replay_of, write_replay
from posse_training.replay.page import check_page

_SIZES: Final = (200, 4096)  # px, least and most
_ARROWS: Final = ("left", "right", "up", "down")
_CHANGE: Final = 2.0  # of the speed's action per second: from rest to full speed in a second
_YOU: Final = (0, 114, 178)  # colour of the player's tracker


@dataclass(frozen=True, kw_only=True)
class _Play(OneWorld):
    """Drive the target against a team, or one tracker in it. Writes a replay page at the end.

    Keys of the window: Left and Right turn, Up and Down change the speed, Space starts and pauses, S steps, - and +
    change the pace, N goes to the next world, Q or Esc ends.
    """

    policy: Annotated[str, tyro.conf.Positional] = "ddcs-tuned"
    """Policy of the trackers: a name, a file, or package.module:Class."""
    robot: Annotated[str, tyro.conf.arg(name="as")] = "target"
    """What you drive: target, or one of the trackers, such as tracker_2."""
    size: tuple[int, int] = (960, 720)
    """Width and height of the window, px."""
    out: Path = Path("play.html")
    """Replay page of the last round, written at the end."""


def main(arguments: Sequence[str]) -> None:
    """Play, and write the replay page."""
    which = tyro.cli(_Play, prog="posse play", args=arguments)
    check_page(which.out)
    scenario = get_scenario(which.scenario, **which.overrides)
    robots = [*(f"tracker_{k}" for k in range(scenario.num_trackers)), "target"]
    if which.robot not in robots:
        raise SettingsError(f"--as {which.robot} is no robot; there are: {', '.join(robots)}")
    rounds, page = play(load(which.policy), scenario, robots.index(which.robot), which.size, **which.place)
    if rounds:
        print(f"rounds: {len(rounds)}, best: {max(rounds):.0f} points")
    if page is None:
        print("Nothing was played: no replay is written.")
        return
    print(f"replay: {write_replay(page, which.out)} (open it in a browser)")


def open_window(scenario: Scenario, size: tuple[int, int], keys: Mapping[str, str]) -> tuple[Renderer, Window]:
    """Open a window; ``keys`` are those beside its own, with what they do."""
    least, most = _SIZES
    if not all(least <= side <= most for side in size):
        raise SettingsError(f"--size {size[0]} {size[1]} must be {least} to {most} px each")
    try:
        renderer = Renderer(scenario, "human", size, keys=keys)
    except RuntimeError as error:
        raise SettingsError(
            f"no window can be opened ({error.__cause__}): posse watch --page records a replay page, --out film.gif "
            "writes a film"
        ) from error
    assert renderer.window is not None
    return renderer, renderer.window


def play(
    policy: Policy, scenario: Scenario, robot: int, size: tuple[int, int], *, seed: int, world: int, split: str
) -> tuple[list[float], Replay | None]:
    """Play rounds in a window until the user closes it; ``robot`` is the user's, N: the target.

    A round lasts an episode. Its points, 0 to 100, are the team's score for a tracker, and what the team missed for
    the target.

    Returns:
        The points of the rounds played to the end, and a replay of the last round; ``None``: nothing was played.
    """
    n = scenario.num_trackers
    scenario = scenario.replace(message_size=max(scenario.message_size, policy.message_size))
    if robot == n:
        if policy.reads_state:
            raise PolicyError(f"{policy.name!r} foresees a scripted target, not a person: choose another policy")
        scenario = scenario.replace(target_motion="agent")
    elif scenario.num_agents != n:
        raise SettingsError(f"the target of {scenario.name!r} is an agent that nobody drives: play as the target")
    who = "you as the target" if robot == n else f"you as tracker {robot}"
    Batch(scenario, 1, seed=seed, split=split, first_world=world).reset()  # finds mistakes before the window opens
    renderer, window = open_window(scenario, size, {"n": "next world"})
    rounds: list[float] = []
    last: Replay | None = None
    window.paused = True
    try:
        while renderer.window:
            batch = Batch(scenario, 1, seed=seed, split=split, first_world=world, autoreset="disabled")
            recorder = Recorder(batch, RECORD)
            renderer.title = f"{who}, world {world}"
            with played_errors():
                scores = _play_round(policy, recorder, robot, renderer, window)
            if scores:
                last = replay_of(recorder.trajectory(), f"{policy.name}, {who}")
            if not recorder.going:
                rounds.append(_points(scores, robot == n))
            if "n" in window.pressed:
                world += 1
                window.paused = True
    finally:
        renderer.close()
    return rounds, last


def _play_round(policy: Policy, recorder: Recorder, robot: int, renderer: Renderer, window: Window) -> list[float]:
    """Play until the episode ends, or the user closes the window or wants another world; return the scores."""
    batch, scenario = recorder.batch, recorder.batch.scenario
    n, title = scenario.num_trackers, renderer.title
    colours = [_YOU if k == robot else TRACKER for k in range(n)]
    memory, observations = begin(policy, batch), recorder.reset()
    speed = 1.0
    scores: list[float] = []
    renderer.draw(batch, colours=colours)
    while renderer.window and recorder.going and "n" not in window.pressed:
        held = window.held(*_ARROWS)
        change = ("up" in held) - ("down" in held)
        speed = min(max(speed + change * _CHANGE * scenario.control_step, -1.0), 1.0)  # stays when no key is held
        turn = ("left" in held) - ("right" in held)
        actions = np.zeros(batch.action_shape, np.float32)
        actions[:, :n], memory = policy.act(np.ascontiguousarray(observations[:, :n]), memory)
        actions[0, robot, :2] = speed, turn
        observations, *_, infos = recorder.step(actions, policy.annotations(memory))
        scores.append(float(infos["score"][0]))
        left = scenario.duration - len(scores) * scenario.control_step
        renderer.title = f"{title}: {_points(scores, robot == n):.0f} points, {left:.0f} s left"
        window.paused |= not recorder.going  # until the user goes on: another round in the same world
        renderer.draw(batch, colours=colours)
    return scores


def _points(scores: Sequence[float], as_target: bool) -> float:
    mean = float(np.mean(scores))
    return 100 * (1 - mean if as_target else mean)
