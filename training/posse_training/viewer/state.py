"""What a viewer shows, and how commands change it: no window, no drawing, no world.

A :class:`State` is a value. :func:`react` returns the state after a command, :func:`advance` the
state after some real time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

SPEEDS: Final = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Speeds to choose from, simulated seconds per second."""
ZOOMS: Final = (0.1, 20.0)
"""Least and greatest zoom; 1: what the camera chooses."""


@dataclass(frozen=True)
class Limits:
    """What a state can refer to.

    Attributes:
        robots: N + 1: the trackers, and the target last.
        policies: Policies to switch between.
        last: The last control step that can be shown.
        second: Control steps in a second, at least 1.
    """

    robots: int
    policies: int
    last: int
    second: int = 10


@dataclass(frozen=True)
class Command:
    """Something that the user asks for.

    Attributes:
        name: One of :data:`COMMANDS`.
        amount: How much, in which direction, or which one; see :data:`COMMANDS`.
        place: A vector, m; see :data:`COMMANDS`.
    """

    name: str
    amount: float = 0.0
    place: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class State:
    """What is shown.

    Attributes:
        step: The control step shown; between two while playing.
        paused: Whether time stands still.
        speed: Index into :data:`SPEEDS`.
        policy: Index of the policy.
        world: Index of the world.
        selected: Number of the selected tracker; the last robot is the target; ``None``: nobody.
        follow: Whether the camera follows the selected robot; otherwise all of them.
        whole: Whether an arena is shown whole.
        zoom: Factor on the camera's own scale.
        offset: From the camera's own centre to the shown one, m.
        links, sensing, trails: Whether they are drawn.
        panel: Whether the panel with the numbers of the selected robot is shown.
        scroll: Lines that the panel is scrolled down.
        help: Whether keys and legend are shown.
        closed: Whether the user has closed the viewer.
    """

    step: float = 0.0
    paused: bool = False
    speed: int = SPEEDS.index(1.0)
    policy: int = 0
    world: int = 0
    selected: int | None = None
    follow: bool = False
    whole: bool = False
    zoom: float = 1.0
    offset: tuple[float, float] = (0.0, 0.0)
    links: bool = True
    sensing: bool = True
    trails: bool = True
    panel: bool = True
    scroll: int = 0
    help: bool = False
    closed: bool = False


COMMANDS: Final[dict[str, str]] = {
    "pause": "Pause or play; at the end, play again from the start.",
    "step": "Pause, and go by `amount` control steps.",
    "second": "Pause, and go by `amount` seconds.",
    "seek": "Go to the step `amount`.",
    "end": "Pause, and go to the last step; what has not been played is played at once.",
    "speed": "Choose the speed `amount` places further in SPEEDS.",
    "policy": "Switch to the policy `amount` places further; the moment stays the same.",
    "world": "Go to the world `amount` further, from its start.",
    "restart": "Go to the start and play.",
    "select": "Select the robot `amount`; the selected one: nobody.",
    "next": "Select the robot `amount` places further.",
    "escape": "Close the help, or select nobody, or close the viewer.",
    "quit": "Close the viewer.",
    "follow": "Let the camera follow the selected robot, or all again.",
    "whole": "Show an arena whole, or where the robots are.",
    "fit": "Undo zoom and pan, and follow all.",
    "zoom": "Zoom by the factor `amount` about a point `place` m from the shown centre.",
    "pan": "Move the view by `place` m.",
    "links": "Radio links on or off.",
    "sensing": "Sensing area and sonar on or off.",
    "trails": "Trails on or off.",
    "panel": "The panel on or off.",
    "scroll": "Scroll the panel by `amount` lines.",
    "help": "Keys and legend on or off.",
}
"""Every command, with its meaning."""

_TOGGLES: Final = ("links", "sensing", "trails", "panel", "help", "whole")


def react(state: State, command: Command, limits: Limits) -> State:
    """Return the state after a command.

    Raises:
        ValueError: An unknown command.
    """
    name, amount = command.name, command.amount
    if name not in COMMANDS:
        raise ValueError(f"unknown command {name!r}; commands are: {', '.join(COMMANDS)}")
    if name in _TOGGLES:
        turned: dict[str, Any] = {name: not getattr(state, name)}
        return replace(state, **turned)
    if name in ("step", "second", "seek", "end", "restart", "pause"):
        return _in_time(state, name, amount, limits)
    if name in ("zoom", "pan", "fit", "follow"):
        return _view(state, command)
    if name in ("select", "next", "escape"):
        return _selection(state, name, amount, limits)
    if name == "speed":
        speed = min(max(state.speed + int(amount), 0), len(SPEEDS) - 1)
        return replace(state, speed=speed)
    if name == "policy":
        return replace(state, policy=(state.policy + int(amount)) % limits.policies)
    if name == "world":
        world = max(0, state.world + int(amount))
        return replace(state, world=world, step=0.0) if world != state.world else state
    if name == "scroll":
        return replace(state, scroll=max(0, state.scroll + int(amount)))
    return replace(state, closed=True)


def advance(state: State, seconds: float, limits: Limits, control_step: float) -> State:
    """Return the state after some real time: time runs at the chosen speed, up to the last step."""
    if state.paused or state.help:
        return state
    step = state.step + seconds * SPEEDS[state.speed] / control_step
    return replace(state, step=min(step, float(limits.last)))


def _in_time(state: State, name: str, amount: float, limits: Limits) -> State:
    if name == "pause":
        if state.step >= limits.last:
            return replace(state, step=0.0, paused=False)
        return replace(state, paused=not state.paused)
    if name == "restart":
        return replace(state, step=0.0, paused=False)
    if name == "seek":
        step, paused = amount, state.paused
    elif name == "end":
        step, paused = float(limits.last), True
    else:
        jump = amount * limits.second if name == "second" else amount
        step, paused = int(state.step + 1e-6) + jump, True
    return replace(state, step=float(min(max(step, 0), limits.last)), paused=paused)


def _view(state: State, command: Command) -> State:
    x, y = state.offset
    if command.name == "fit":
        return replace(state, zoom=1.0, offset=(0.0, 0.0), follow=False, whole=False)
    if command.name == "follow":
        follow = not state.follow and state.selected is not None
        return replace(state, follow=follow, offset=(0.0, 0.0))
    if command.name == "pan":
        return replace(state, offset=(x + command.place[0], y + command.place[1]))
    zoom = min(max(state.zoom * command.amount, ZOOMS[0]), ZOOMS[1])
    stays = 1 - state.zoom / zoom  # the point under the pointer stays where it is
    offset = (x + stays * command.place[0], y + stays * command.place[1])
    return replace(state, zoom=zoom, offset=offset)


def _selection(state: State, name: str, amount: float, limits: Limits) -> State:
    if name == "escape":
        if state.help:
            return replace(state, help=False)
        if state.selected is None:
            return replace(state, closed=True)
        return replace(state, selected=None, follow=False, scroll=0)
    if name == "next":
        if state.selected is None:
            chosen = 0 if amount > 0 else limits.robots - 1
        else:
            chosen = (state.selected + int(amount)) % limits.robots
        return replace(state, selected=chosen)
    chosen = int(amount)
    if not 0 <= chosen < limits.robots:
        return state
    if chosen == state.selected:
        return replace(state, selected=None, follow=False, scroll=0)
    return replace(state, selected=chosen)
