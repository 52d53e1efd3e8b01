"""The viewer without a window: events in, pictures and numbers out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pygame
import pytest

import posse
from posse.rendering.canvas import pixels
from posse.rendering.style import INK, TARGET
from posse_baselines import PolicyError, load
from posse_training.cli import main
from posse_training.errors import SettingsError
from posse_training.viewer import tape as tape_module
from posse_training.viewer.layout import contains, lay_out
from posse_training.viewer.panel import lines_of
from posse_training.viewer.state import Command
from posse_training.viewer.tape import Tape
from posse_training.viewer.viewer import Viewer
from posse_training.viewer.window import open_window, run

Frame = npt.NDArray[np.uint8]


def viewer(*policies: str, scenario: str = "field", **settings: Any) -> Viewer:
    made = posse.get_scenario(scenario, **settings)
    return Viewer(policies or ("pursuit",), made, size=(960, 640))


def press(shown: Viewer, key: int, **more: Any) -> None:
    given: dict[str, Any] = {"key": key, "mod": 0, "unicode": ""} | more
    shown.handle(pygame.event.Event(pygame.KEYDOWN, given))


def play(shown: Viewer, step: int) -> None:
    """Play up to a step, and pause there."""
    shown.do(Command("seek", step))
    while shown.tape.last < step and not shown.tape.over:
        shown.tick(0.0)
    if not shown.state.paused:
        shown.do(Command("pause"))


def picture(shown: Viewer) -> Frame:
    return pixels(shown.draw())


def mouse(shown: Viewer, kind: int, at: Any, **more: Any) -> None:
    place = (float(at[0]), float(at[1]))
    shown.handle(pygame.event.Event(kind, pos=place, **more))


# --- time ----------------------------------------------------------------------------------------


def test_a_tape_plays_what_the_policy_plays_alone() -> None:
    scenario = posse.get_scenario("field")
    tape = Tape(load("pursuit"), scenario, 7, 3, "test")
    tape.play(40, most=100)
    batch = posse.Batch(scenario, 1, seed=7, split="test", first_world=3)
    policy = load("pursuit")
    memory, seen = policy.begin(batch.layout, 1), batch.reset()
    for step in range(41):
        moment = tape.moment(step)
        assert moment.scene.step == step
        np.testing.assert_array_equal(moment.observations, seen[0])
        np.testing.assert_array_equal(moment.scene.position[:, 0], batch.state["tracker_x"][0])
        actions, memory = policy.act(seen, memory)
        assert moment.actions is not None
        np.testing.assert_array_equal(moment.actions, actions[0])
        seen, *_ = batch.step(actions)


def test_going_back_shows_the_same_picture() -> None:
    shown = viewer()
    play(shown, 30)
    # From a fresh camera, since the automatic one moves smoothly.
    press(shown, pygame.K_a)
    first = picture(shown)
    for key, step in ((pygame.K_RIGHT, 31), (pygame.K_RIGHT, 32), (pygame.K_LEFT, 31)):
        press(shown, key)
        assert shown.moment.scene.step == step
    assert (picture(shown) != first).any()
    press(shown, pygame.K_LEFT)
    np.testing.assert_array_equal(picture(shown), first)
    press(shown, pygame.K_LEFT, mod=pygame.KMOD_LSHIFT)
    assert shown.moment.scene.step == 20
    press(shown, pygame.K_END)
    while shown.tape.last < 600:
        shown.tick(0.03)
    assert shown.tape.over
    assert shown.moment.scene.step == 600


def test_time_runs_while_it_plays_and_stands_while_it_does_not() -> None:
    shown = viewer()
    for _ in range(10):
        shown.tick(0.1)
    assert shown.moment.scene.step == 10
    press(shown, pygame.K_SPACE)
    shown.tick(1.0)
    assert shown.moment.scene.step == 10
    press(shown, pygame.K_SPACE)
    press(shown, pygame.K_RIGHTBRACKET)  # twice as fast
    for _ in range(10):
        shown.tick(0.1)
    assert shown.moment.scene.step == 30


def test_old_moments_are_forgotten_when_there_are_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tape_module, "_MOST_BYTES", 1)
    monkeypatch.setattr(tape_module, "_LEAST_KEPT", 40)
    tape = Tape(load("idle"), posse.get_scenario("smart"), 7, 0, "test")
    tape.play(100, most=100)
    assert tape.last == 100
    assert 60 <= tape.first <= 80
    assert tape.moment(0).scene.step == tape.first
    assert tape.moment(tape.first + 3).scene.step == tape.first + 3
    tape.history(tape.first)


def test_the_next_world_is_another_and_the_one_before_comes_back() -> None:
    shown = viewer()
    first = shown.moment.scene.position
    press(shown, pygame.K_w)
    assert shown.state.world == 1
    assert (shown.moment.scene.position != first).any()
    press(shown, pygame.K_w, mod=pygame.KMOD_LSHIFT)
    np.testing.assert_array_equal(shown.moment.scene.position, first)


def test_another_policy_plays_the_same_world_up_to_the_same_moment() -> None:
    shown = viewer("pursuit", "idle")
    play(shown, 25)
    before = shown.moment.scene
    press(shown, pygame.K_p)
    while shown.tape.last < 25:
        shown.tick(0.03)
    assert shown.tape.name == "idle"
    assert shown.moment.scene.step == 25
    assert shown.moment.scene.episode == before.episode
    assert (shown.moment.scene.position != before.position).any()
    press(shown, pygame.K_p)
    np.testing.assert_array_equal(shown.moment.scene.position, before.position)


def test_what_is_being_loaded_is_said_before() -> None:
    told: list[str] = []
    shown = Viewer(
        ("pursuit", "ddcs-distributed"),
        posse.get_scenario("field"),
        size=(960, 640),
        show=lambda _: told.append(shown.message),
    )
    assert told == []
    for command in (Command("policy", 1), Command("policy", -1), Command("world", 1)):
        shown.do(command)
        assert shown.message == ""
    first, second = told  # what has been loaded is there at once
    assert first == "Loading ddcs-distributed, world 0 ..."
    assert second == "Loading pursuit, world 1 ..."


def test_a_policy_that_cannot_play_is_said_and_changes_nothing() -> None:
    shown = viewer("pursuit", "no-such-policy")
    play(shown, 5)
    state, calm = shown.state, picture(shown)
    press(shown, pygame.K_p)
    assert "unknown policy 'no-such-policy'" in shown.message
    assert (shown.state, shown.tape.name) == (state, "pursuit")
    assert (picture(shown) != calm).any()
    press(shown, pygame.K_z)
    shown.do(Command("seek", 5))
    assert not shown.message


def test_what_cannot_be_watched_is_named() -> None:
    with pytest.raises(PolicyError, match=r"the target of 'smart' is an agent.*posse play"):
        viewer(scenario="smart", target_motion="agent")


# --- view ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(1280, 720), (480, 360), (320, 240), (100, 50)])
@pytest.mark.parametrize("num_trackers", [5, 12, 40])
def test_every_window_shows_all_robots(size: tuple[int, int], num_trackers: int) -> None:
    formation = "ring" if num_trackers < 40 else "rows"
    shown = viewer("idle", num_trackers=num_trackers, formation=formation)
    shown.handle(pygame.event.Event(pygame.VIDEORESIZE, w=size[0], h=size[1]))
    frame = picture(shown)
    assert frame.shape == (max(size[1], 240), max(size[0], 320), 3)
    scene, viewport = shown.moment.scene, shown.camera.viewport
    for place in shown.camera.project(np.vstack([scene.position, scene.target])):
        assert contains(viewport, (place[0], place[1]))
    column, row = shown.camera.project(scene.target).round().astype(int)
    patch = frame[row - 2 : row + 3, column - 2 : column + 3].astype(int)
    assert (np.abs(patch - TARGET).max(axis=-1) <= 3).any()


def test_a_click_selects_and_the_panel_opens() -> None:
    shown = viewer()
    play(shown, 30)
    place = shown.camera.project(shown.moment.scene.position[3])
    plain = picture(shown)
    mouse(shown, pygame.MOUSEBUTTONDOWN, place, button=1)
    mouse(shown, pygame.MOUSEBUTTONUP, place, button=1)
    assert shown.state.selected == 3
    layout = shown.layout
    assert layout.panel is not None
    frame = picture(shown)
    left = layout.panel[0]
    assert (frame[:560, left + 2 :] != plain[:560, left + 2 :]).any()
    # A ring of ink around it.
    column, row = shown.camera.project(shown.moment.scene.position[3]).round().astype(int)
    patch = frame[row - 16 : row + 17, column - 16 : column + 17].astype(int)
    assert (np.abs(patch - INK).max(axis=-1) <= 12).sum() > 40
    press(shown, pygame.K_ESCAPE)
    assert shown.state.selected is None
    assert shown.layout.panel is None


def test_dragging_moves_the_world_with_the_pointer() -> None:
    shown = viewer()
    play(shown, 10)
    start, end = (400.0, 300.0), (460.0, 250.0)
    point = shown.camera.unproject(np.array(start))
    mouse(shown, pygame.MOUSEBUTTONDOWN, start, button=1)
    mouse(shown, pygame.MOUSEMOTION, (430.0, 280.0), buttons=(1, 0, 0))
    mouse(shown, pygame.MOUSEMOTION, end, buttons=(1, 0, 0))
    mouse(shown, pygame.MOUSEBUTTONUP, end, button=1)
    np.testing.assert_allclose(shown.camera.project(point), end, atol=1e-6)
    assert shown.state.selected is None  # a drag is no click


def test_the_wheel_zooms_about_the_pointer() -> None:
    shown = viewer()
    play(shown, 10)
    at, scale = (300.0, 200.0), shown.camera.scale
    point = shown.camera.unproject(np.array(at))
    mouse(shown, pygame.MOUSEMOTION, at, buttons=(0, 0, 0))
    shown.handle(pygame.event.Event(pygame.MOUSEWHEEL, y=3))
    np.testing.assert_allclose(shown.camera.project(point), at, atol=1e-6)
    assert shown.camera.scale == pytest.approx(scale * 1.15**3)
    press(shown, pygame.K_c)
    assert shown.camera.scale == pytest.approx(scale)


def test_following_keeps_a_robot_in_the_middle() -> None:
    shown = viewer()
    press(shown, pygame.K_1)
    press(shown, pygame.K_f)
    for step in (0, 20, 40):
        play(shown, step)
        left, top, width, height = shown.camera.viewport
        place = shown.camera.project(shown.moment.scene.position[1])
        np.testing.assert_allclose(place, (left + width / 2, top + height / 2))


def test_the_timeline_seeks() -> None:
    shown = viewer()
    left, top, width, height = shown.layout.track
    mouse(shown, pygame.MOUSEBUTTONDOWN, (left + width / 10, top + height / 2), button=1)
    while shown.tape.last < 60:
        shown.tick(0.0)
    assert shown.moment.scene.step == 60
    mouse(shown, pygame.MOUSEMOTION, (left, top), buttons=(1, 0, 0))
    assert shown.moment.scene.step == 0
    mouse(shown, pygame.MOUSEBUTTONUP, (left, top), button=1)
    mouse(shown, pygame.MOUSEBUTTONDOWN, (10.0, top + height / 2), button=1)
    assert shown.state.paused


@pytest.mark.parametrize("size", [(1280, 720), (480, 360)])
def test_the_help_covers_the_window_and_fits_it(size: tuple[int, int]) -> None:
    shown = viewer()
    shown.resize(size)
    press(shown, pygame.K_UNKNOWN, unicode="?")
    assert shown.state.help
    frame = picture(shown).astype(int)
    edges = [frame[0], frame[-1], frame[:, 0], frame[:, -1]]
    assert all((edge == edge[0]).all() for edge in edges)  # nothing is cut off
    assert (np.abs(frame - TARGET).max(axis=-1) <= 3).sum() > 10  # its sample in the legend
    press(shown, pygame.K_ESCAPE)
    assert not shown.state.help
    assert not shown.closed


# --- the panel -----------------------------------------------------------------------------------


def test_the_panel_says_what_the_robot_observed() -> None:
    shown = viewer("ddcs-distributed")
    play(shown, 60)
    moment, layout = shown.moment, shown.tape.layout
    for robot in range(5):
        # The same words stand for team-mates, further down.
        lines = {line.name: line for line in reversed(lines_of(moment, layout, robot))}
        views = layout.views(moment.observations[robot])
        assert float(lines["speed"].value.replace("\N{MINUS SIGN}", "-")) == pytest.approx(
            float(views["speed"]), abs=0.006
        )
        known = bool(views["target_known"])
        assert lines["target range"].known == known
        assert (lines["target range"].value == "not known") == (not known)
        assert lines["sees the target"].value == ("yes" if moment.scene.sees[robot] else "no")
        assert lines["task"].value in ("searching", "converging", "flocking")
        assert "leader" not in lines
        blocks = [line.name for line in lines_of(moment, layout, robot) if line.is_heading]
        assert blocks[:4] == ["action and reward", "observed: own motion", "observed: target", "observed: sonar"]
        assert blocks[-1] == "observed: task"
    target = {line.name: line.value for line in lines_of(moment, layout, 5)}
    assert target["slots occupied"] == f"{int(moment.scene.occupied.sum())} of 5"


def test_unknown_values_are_said_to_be_unknown() -> None:
    shown = viewer("idle", scenario="search", start_distance=(8.0, 12.0))
    lines = {line.name: line for line in reversed(lines_of(shown.moment, shown.tape.layout, 0))}
    assert not lines["last fix"].known
    for name in ("target range", "target bearing", "target velocity"):
        assert (lines[name].known, lines[name].value) == (False, "not known"), name
    assert lines["heading"].known


def test_the_panel_scrolls_as_far_as_there_are_lines() -> None:
    shown = viewer()
    press(shown, pygame.K_0)
    first = picture(shown)
    press(shown, pygame.K_PAGEDOWN)
    assert 0 < shown.state.scroll <= 15
    assert (picture(shown) != first).any()
    for _ in range(20):
        press(shown, pygame.K_PAGEDOWN)
    total = len(lines_of(shown.moment, shown.tape.layout, 0))
    assert total - 60 < shown.state.scroll < total
    press(shown, pygame.K_i)
    assert shown.layout.panel is None


def test_boxes_fill_the_window_and_do_not_overlap() -> None:
    for size in ((1280, 720), (480, 360), (1, 1), (3000, 500)):
        for panel in (True, False):
            made = lay_out(size, panel)
            boxes = [made.picture, made.bar, *([made.panel] if made.panel else [])]
            assert sum(w * h for _, _, w, h in boxes) == math.prod(made.size)
            for k, (x, y, w, h) in enumerate(boxes):
                assert min(w, h) > 0
                centre = (x + w / 2, y + h / 2)
                assert [contains(box, centre) for box in boxes].index(True) == k


# --- the window ----------------------------------------------------------------------------------


def test_the_window_reacts_to_what_is_posted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    shown = viewer()
    open_window((640, 480), "test", "")
    try:
        for key in (pygame.K_2, pygame.K_SPACE, pygame.K_q):
            pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key, mod=0, unicode=""))
        run(shown)
    finally:
        pygame.display.quit()
    assert shown.state.selected == 2
    assert shown.state.paused
    assert shown.closed
    assert not pygame.display.get_init()


def test_without_a_display_the_error_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(SettingsError, match=r"No window can be opened: neither DISPLAY.*--film"):
        open_window((640, 480), "test", "write a film: --film film.gif")
    monkeypatch.setenv("SDL_VIDEODRIVER", "no such driver")
    with pytest.raises(SettingsError, match="No window can be opened"):
        open_window((640, 480), "test", "")


def test_the_command_shows_the_policies_given(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")

    def at_the_keys(shown: Viewer) -> None:
        play(shown, 5)
        press(shown, pygame.K_p)
        play(shown, 20)
        pygame.display.quit()

    monkeypatch.setattr("posse_training.viewer.window.run", at_the_keys)
    assert main(["watch", "pursuit", "idle", "--scenario", "constant"]) == 0
    assert capsys.readouterr().out == "idle: score 0.000 after 2.0 s\n"
