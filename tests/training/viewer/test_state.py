"""What a viewer shows follows from commands and time alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pygame
import pytest

from posse_training.viewer.keys import BINDINGS, command_of
from posse_training.viewer.state import COMMANDS, SPEEDS, ZOOMS, Command, Limits, State, advance, react

LIMITS = Limits(robots=6, policies=3, last=600, second=10)


def after(state: State, *commands: Command) -> State:
    for command in commands:
        state = react(state, command, LIMITS)
    return state


def test_time_runs_at_the_chosen_speed_and_stops_at_the_end() -> None:
    state = State()
    for speed in SPEEDS:
        state = replace(state, speed=SPEEDS.index(speed), step=0.0)
        moved = advance(state, 0.5, LIMITS, control_step=0.1)
        assert moved.step == pytest.approx(0.5 * speed / 0.1)
    assert advance(replace(state, step=599.0), 9.0, LIMITS, 0.1).step == 600
    for still in (replace(state, paused=True), replace(state, help=True)):
        assert advance(still, 1.0, LIMITS, 0.1) == still


def test_steps_and_seconds_pause_and_stay_within_the_episode() -> None:
    state = after(State(step=50.7), Command("step", 1))
    assert (state.step, state.paused) == (51, True)
    assert after(state, Command("step", -1)).step == 50
    assert after(state, Command("second", 1)).step == 61
    assert after(state, Command("second", -9)).step == 0
    assert after(state, Command("seek", 1e9)).step == 600
    assert after(state, Command("end")).step == 600


def test_play_at_the_end_begins_anew() -> None:
    assert after(State(step=600.0, paused=True), Command("pause")) == State()
    assert after(State(step=9.0), Command("pause")) == State(step=9.0, paused=True)


def test_speeds_and_worlds_have_ends_and_policies_go_round() -> None:
    state = after(State(), *[Command("speed", 1)] * 20)
    assert SPEEDS[state.speed] == max(SPEEDS)
    state = after(state, *[Command("speed", -1)] * 20)
    assert SPEEDS[state.speed] == min(SPEEDS)
    assert after(State(), Command("world", -1)) == State()
    assert after(State(step=80.0), Command("world", 2)) == State(world=2)
    assert after(State(step=80.0), Command("policy", -1)) == State(step=80.0, policy=2)
    assert after(State(policy=2), Command("policy", 1)).policy == 0


def test_selecting_following_and_escaping() -> None:
    state = after(State(), Command("follow"))
    assert not state.follow  # nobody is selected
    state = after(state, Command("select", 2), Command("follow"))
    assert (state.selected, state.follow) == (2, True)
    assert after(state, Command("next", 1)).selected == 3
    assert after(State(), Command("next", -1)).selected == 5
    assert after(state, Command("select", 2)).selected is None
    assert after(state, Command("select", 9)) == state  # there is no such robot
    state = after(state, Command("help"))
    for expected in ((2, False, False), (None, False, False), (None, False, True)):
        state = after(state, Command("escape"))
        assert (state.selected, state.help, state.closed) == expected


def test_zoom_keeps_the_point_under_the_pointer() -> None:
    # The shown centre is base + offset; a point `place` from it lies `place * zoom` off the middle.
    state, base, point = State(zoom=1.5, offset=(2.0, -1.0)), np.array([4.0, 4.0]), np.array([7, 1])
    before = (point - (base + state.offset)) * state.zoom
    place = point - (base + state.offset)
    zoomed = after(state, Command("zoom", 1.7, (float(place[0]), float(place[1]))))
    assert zoomed.zoom == pytest.approx(1.5 * 1.7)
    np.testing.assert_allclose((point - (base + zoomed.offset)) * zoomed.zoom, before)
    # Beyond the limit neither zoom nor place changes any more.
    far = after(State(zoom=ZOOMS[1]), Command("zoom", 2.0, (3.0, 0.0)))
    assert far == State(zoom=ZOOMS[1])
    assert after(zoomed, Command("pan", place=(1.0, 2.0)), Command("fit")) == State()


@pytest.mark.parametrize("name", ["links", "sensing", "trails", "panel", "help", "whole"])
def test_toggles_go_back_and_forth(name: str) -> None:
    once = after(State(), Command(name))
    assert getattr(once, name) != getattr(State(), name)
    assert after(once, Command(name)) == State()


def test_an_unknown_command_is_named() -> None:
    with pytest.raises(ValueError, match="unknown command 'jump'; commands are: pause"):
        react(State(), Command("jump"), LIMITS)


def test_every_key_has_one_meaning_and_every_command_exists() -> None:
    keys = [key for binding in BINDINGS for key in binding.commands]
    assert len(keys) == len(set(keys))
    commands = {c.name for binding in BINDINGS for c in binding.commands.values()}
    assert commands | {"pan"} == set(COMMANDS)  # panning is the mouse's
    assert command_of(pygame.K_3, False) == Command("select", 3)
    assert command_of(pygame.K_KP7, False) == Command("select", 7)
    assert command_of(pygame.K_z, False) is None
