"""Which key asks for what. The same letters as on a replay page, where both have the command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import pygame

from posse_training.viewer.state import Command

_KEYPAD: Final = (
    pygame.K_KP0,
    pygame.K_KP1,
    pygame.K_KP2,
    pygame.K_KP3,
    pygame.K_KP4,
    pygame.K_KP5,
    pygame.K_KP6,
    pygame.K_KP7,
    pygame.K_KP8,
    pygame.K_KP9,
)
_STEP: Final = 1.25  # factor of a zoom by key


@dataclass(frozen=True)
class Binding:
    """Keys with one meaning.

    Attributes:
        keys: As the help names them.
        text: What they do.
        commands: By (pygame's key, whether Shift is held).
    """

    keys: str
    text: str
    commands: dict[tuple[int, bool], Command]


def _pair(less: int, more: int, name: str, amount: float = 1.0) -> dict[tuple[int, bool], Command]:
    return {(less, False): Command(name, -amount), (more, False): Command(name, amount)}


def _either(key: int, command: Command) -> dict[tuple[int, bool], Command]:
    return {(key, False): command, (key, True): command}


BINDINGS: Final = (
    Binding("Space", "play or pause", _either(pygame.K_SPACE, Command("pause"))),
    Binding("Left, Right", "one step back, forth", _pair(pygame.K_LEFT, pygame.K_RIGHT, "step")),
    Binding(
        "Shift + Left, Right",
        "one second back, forth",
        {(pygame.K_LEFT, True): Command("second", -1.0), (pygame.K_RIGHT, True): Command("second", 1.0)},
    ),
    Binding(
        "Home, End",
        "to the start, to the end",
        {**_either(pygame.K_HOME, Command("seek", 0.0)), **_either(pygame.K_END, Command("end"))},
    ),
    Binding("[ ]", "slower, faster", _pair(pygame.K_LEFTBRACKET, pygame.K_RIGHTBRACKET, "speed")),
    Binding("R", "again from the start", _either(pygame.K_r, Command("restart"))),
    Binding(
        "P, Shift + P",
        "next policy, policy before; at the same moment",
        {(pygame.K_p, False): Command("policy", 1), (pygame.K_p, True): Command("policy", -1)},
    ),
    Binding(
        "W, Shift + W",
        "next world, world before",
        {(pygame.K_w, False): Command("world", 1), (pygame.K_w, True): Command("world", -1)},
    ),
    Binding(
        "0 to 9",
        "select a tracker",
        {(key, False): Command("select", digit) for digit in range(10) for key in (pygame.K_0 + digit, _KEYPAD[digit])},
    ),
    Binding(
        "Tab, Shift + Tab",
        "select the next robot, the one before",
        {(pygame.K_TAB, False): Command("next", 1), (pygame.K_TAB, True): Command("next", -1)},
    ),
    Binding("F", "follow the selected robot, or all", _either(pygame.K_f, Command("follow"))),
    Binding(
        "+ -",
        "zoom in, out",
        {
            **_either(pygame.K_PLUS, Command("zoom", _STEP)),
            **_either(pygame.K_EQUALS, Command("zoom", _STEP)),
            **_either(pygame.K_KP_PLUS, Command("zoom", _STEP)),
            **_either(pygame.K_MINUS, Command("zoom", 1 / _STEP)),
            **_either(pygame.K_KP_MINUS, Command("zoom", 1 / _STEP)),
        },
    ),
    Binding("C", "undo zoom and pan, follow all", _either(pygame.K_c, Command("fit"))),
    Binding("A", "whole arena, or where the robots are", _either(pygame.K_a, Command("whole"))),
    Binding(
        "L, S, T",
        "radio links, sensing, trails",
        {
            **_either(pygame.K_l, Command("links")),
            **_either(pygame.K_s, Command("sensing")),
            **_either(pygame.K_t, Command("trails")),
        },
    ),
    Binding("I", "panel of the selected robot", _either(pygame.K_i, Command("panel"))),
    Binding(
        "Page up, down",
        "scroll the panel",
        {**_either(pygame.K_PAGEUP, Command("scroll", -15)), **_either(pygame.K_PAGEDOWN, Command("scroll", 15))},
    ),
    Binding(
        "H or ?", "keys and legend", {**_either(pygame.K_h, Command("help")), (pygame.K_SLASH, True): Command("help")}
    ),
    Binding("Esc", "close the help; select nobody; quit", _either(pygame.K_ESCAPE, Command("escape"))),
    Binding("Q", "quit", _either(pygame.K_q, Command("quit"))),
)
"""Every key of the viewer, in the order of the help."""
MOUSE: Final = (
    ("click", "select a robot; on the timeline, go to that moment"),
    ("drag", "move the view, or along the timeline"),
    ("wheel", "zoom at the pointer; over the panel, scroll"),
)
"""What the mouse does, in the order of the help."""

_BY_KEY: Final = {key: command for each in BINDINGS for key, command in each.commands.items()}


def command_of(key: int, shift: bool) -> Command | None:
    """Return what a key of pygame asks for; ``None``: nothing."""
    return _BY_KEY.get((key, shift))
