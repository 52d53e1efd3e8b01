"""A person plays: keys in, actions, points and a replay out."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest

import posse
from posse.rendering.canvas import pixels
from posse_baselines import PolicyError, load
from posse_training.cli import main
from posse_training.errors import SettingsError
from posse_training.play.game import Game, robot_of
from posse_training.play.session import (
    COUNTDOWN,
    OVER,
    PAUSED,
    READY,
    RUNNING,
    Session,
    advance,
    finish,
    points_of,
    react,
)
from posse_training.play.steering import Wheel, steer
from posse_training.replay import read_replay, write_replay

SHORT = 30  # control steps of a round


def game(robot: str = "target", policy: str = "pursuit", **settings: Any) -> Game:
    scenario = posse.get_scenario("smart", **{"horizon": SHORT, "settle_time": 1.0} | settings)
    return Game(load(policy), scenario, robot_of(robot, scenario.num_trackers), size=(640, 480))


def press(played: Game, key: int) -> None:
    played.handle(pygame.event.Event(pygame.KEYDOWN, key=key, mod=0, unicode=""))


def let_go(played: Game, key: int) -> None:
    played.handle(pygame.event.Event(pygame.KEYUP, key=key, mod=0))


def start(played: Game) -> None:
    press(played, pygame.K_RETURN)
    played.tick(3.0)
    assert played.session.phase == RUNNING


# --- the session ---------------------------------------------------------------------------------


def test_a_round_is_counted_down_played_and_scored() -> None:
    session = react(Session(), "go")
    assert (session.phase, session.left) == (COUNTDOWN, 3.0)
    session = advance(session, 2.5)
    assert (session.phase, session.left) == (COUNTDOWN, 0.5)
    session = advance(session, 0.5)
    assert session.phase == RUNNING
    assert react(react(session, "pause"), "pause") == session
    assert react(react(session, "pause"), "go").phase == RUNNING
    for points, best in ((40.0, 40.0), (70.0, 70.0), (10.0, 70.0)):
        session = finish(session, points)
        assert (session.phase, session.best) == (OVER, best)
    assert session.rounds == (40.0, 70.0, 10.0)
    assert react(session, "go").begun == 2
    assert react(session, "next") == Session(READY, 1, 0.0, (40.0, 70.0, 10.0), 1)
    assert react(session, "quit").closed


def test_keys_without_a_meaning_now_change_nothing() -> None:
    assert react(Session(), "pause") == Session()
    running = Session(RUNNING, begun=1)
    assert react(running, "next") == running
    assert react(running, "go") == running
    assert advance(running, 5.0) == running
    with pytest.raises(ValueError, match="unknown key 'jump'"):
        react(running, "jump")


def test_what_the_team_gets_the_target_loses() -> None:
    for score in (0.0, 0.3, 1.0):
        assert points_of(score, False) == pytest.approx(100 * score)
        assert points_of(score, True) + points_of(score, False) == pytest.approx(100)


@pytest.mark.parametrize(
    "keys",
    [(pygame.K_LEFT, pygame.K_RIGHT, pygame.K_UP, pygame.K_DOWN), (pygame.K_a, pygame.K_d, pygame.K_w, pygame.K_s)],
)
def test_arrows_and_letters_steer(keys: tuple[int, ...]) -> None:
    left, right, up, down = keys
    assert steer(Wheel(0.0), {left}, 0.1) == Wheel(0.0, 1.0)
    assert steer(Wheel(0.0), {right}, 0.1) == Wheel(0.0, -1.0)
    assert steer(Wheel(0.0, 1.0), {left, right}, 0.1) == Wheel(0.0, 0.0)
    assert steer(Wheel(0.0), {up}, 0.25) == Wheel(0.5, 0.0)
    assert steer(Wheel(0.0), {down}, 9.0) == Wheel(-1.0, 0.0)
    assert steer(Wheel(0.4, 1.0), (), 0.1) == Wheel(0.4, 0.0)  # the speed stays


# --- the game ------------------------------------------------------------------------------------


def test_the_player_drives_the_target() -> None:
    played = game()
    start(played)
    press(played, pygame.K_LEFT)
    scene = played.round.scene
    before = np.arctan2(*scene.target_heading[::-1]), scene.target.copy()
    for _ in range(5):
        played.tick(0.1)
    scene = played.round.scene
    assert scene.step == 5
    turned = (np.arctan2(*scene.target_heading[::-1]) - before[0]) % (2 * np.pi)
    assert turned == pytest.approx(5 * 0.1 * scene.scenario.target_turn_rate, abs=1e-3)
    let_go(played, pygame.K_LEFT)
    press(played, pygame.K_s)  # a second from full speed to rest
    for _ in range(11):
        played.tick(0.1)
    place = played.round.scene.target.copy()
    played.tick(0.1)
    np.testing.assert_allclose(played.round.scene.target, place)


def test_the_player_drives_one_tracker_and_the_policy_the_others() -> None:
    frames: list[Any] = []
    for key in (None, pygame.K_d):
        played = game("tracker_2", policy="idle")
        start(played)
        if key is not None:
            press(played, key)
        for _ in range(8):
            played.tick(0.1)
        frames.append(played.round.scene)
    straight, turning = frames
    moved = np.hypot(*(straight.position - game("tracker_2", "idle").round.scene.position).T)
    assert moved[2] == pytest.approx(0.8, abs=1e-3)  # at 1 m/s
    assert (np.delete(moved, 2) == 0).all()
    assert (straight.heading[2] != turning.heading[2]).any()
    np.testing.assert_array_equal(np.delete(straight.heading, 2, 0), np.delete(turning.heading, 2, 0))


def test_a_session_keeps_its_best_and_shows_best_and_last_side_by_side(tmp_path: Path) -> None:
    played = game("tracker_0")
    points = []
    for key in (None, pygame.K_d):
        start(played)
        if key is not None:
            press(played, key)
        for _ in range(SHORT):
            played.tick(0.1)
        assert played.session.phase == OVER
        points.append(played.round.points)
    assert played.session.rounds == tuple(points)
    assert played.session.best == max(points)
    replay = played.replay()
    assert replay is not None
    assert all(player.frames == SHORT + 1 for player in replay.players)
    assert all("you as tracker 0" in player.name for player in replay.players)
    assert len(read_replay(write_replay(replay, tmp_path / "r.html")).players) == len(replay.players)


def test_a_round_that_is_cut_short_is_recorded_too() -> None:
    played = game()
    assert played.replay() is None
    start(played)
    for _ in range(7):
        played.tick(0.1)
    press(played, pygame.K_ESCAPE)
    assert played.closed
    replay = played.replay()
    assert replay is not None
    assert replay.players[0].frames == 8
    assert replay.world["settings"]["target_motion"] == "agent"


def test_the_next_world_is_another_and_again_is_the_same() -> None:
    played = game()
    first = played.round.scene
    start(played)
    for _ in range(SHORT):
        played.tick(0.1)
    press(played, pygame.K_SPACE)
    np.testing.assert_array_equal(played.round.scene.position, first.position)
    assert played.round.scene.step == 0
    played.tick(3.0)
    for _ in range(SHORT):
        played.tick(0.1)
    press(played, pygame.K_n)
    assert played.session.phase == READY
    assert (played.round.scene.position != first.position).any()


def test_a_window_in_the_background_pauses() -> None:
    played = game()
    start(played)
    played.handle(pygame.event.Event(pygame.WINDOWFOCUSLOST))
    assert played.session.phase == PAUSED
    played.tick(1.0)
    assert played.round.scene.step == 0


@pytest.mark.parametrize("size", [(1280, 720), (400, 300)])
def test_every_phase_has_a_picture_with_the_points(size: tuple[int, int]) -> None:
    played = game()
    played.handle(pygame.event.Event(pygame.VIDEORESIZE, w=size[0], h=size[1]))
    frames = [pixels(played.draw())]
    press(played, pygame.K_RETURN)
    played.tick(0.5)
    frames.append(pixels(played.draw()))
    played.tick(3.0)
    for _ in range(5):
        played.tick(0.1)
    frames.append(pixels(played.draw()))
    press(played, pygame.K_p)
    frames.append(pixels(played.draw()))
    for before, after in itertools.pairwise(frames):
        assert after.shape == (size[1], size[0], 3)
        assert (before != after).any()


# --- the command ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--as", "tracker_9"], "--as tracker_9 is no robot; there are: target, tracker_0"),
        (["--against", "nobody"], "unknown policy 'nobody'"),
        (["--against", "planner"], "cannot play against a person"),
        (["--scenario", "smrt"], "unknown scenario 'smrt'"),
        (["--out", "play.txt"], "--out play.txt must end in .html"),
        (["--size", "10", "10"], "--size 10 10 must be 200 to 4096 px"),
        (["--world", "-1"], "world=-1"),
    ],
)
def test_mistakes_are_named(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["play", *arguments]) == 2
    assert message in " ".join(capsys.readouterr().err.split())


def test_the_command_plays_and_writes_a_replay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")

    def at_the_keys(played: Game) -> None:
        start(played)
        for _ in range(12):
            played.tick(0.1)
        press(played, pygame.K_ESCAPE)
        pygame.display.quit()

    monkeypatch.setattr("posse_training.viewer.window.run", at_the_keys)
    out = tmp_path / "mine.html"
    assert main(["play", "--against", "pursuit", "--out", str(out)]) == 0
    assert read_replay(out).players[0].frames == 13
    assert "replay: " in capsys.readouterr().out


def test_robots_have_names() -> None:
    assert [robot_of(n, 3) for n in ("target", "target_0", "tracker_0", "tracker_2")] == [3, 3, 0, 2]
    with pytest.raises(SettingsError, match="tracker_1 is no robot"):
        robot_of("tracker_1", 1)
    with pytest.raises(PolicyError, match="against a person"):
        game(policy="planner")
