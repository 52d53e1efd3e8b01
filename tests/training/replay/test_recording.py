"""Recordings agree with the played steps and the engine's counts, also after writing and reading."""

from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

import posse
from posse_baselines import Recorder, batch_for, begin, load
from posse_training.replay import RECORD, Player, Replay, record, replay_of
from posse_training.replay.columns import find_events
from posse_training.replay.format import decode, encode, resolution_of


def close(columns: dict[str, Any], name: str, frame: int, value: Any, angle: bool = False) -> None:
    """One row of a column is a value, to half the column's resolution (whole numbers: exactly)."""
    resolution = resolution_of(name, columns[name])
    off = np.asarray(columns[name][frame], np.float64) - np.asarray(value, np.float64)
    if angle:
        off = (off + np.pi) % (2 * np.pi) - np.pi
    allowed = 1e-9 if resolution == 1 else resolution * 0.501
    assert np.abs(off).max(initial=0) <= allowed


@pytest.mark.parametrize("value", [np.full((1, 5), "calm"), np.zeros(1), None])
def test_annotations_that_are_no_numbers_of_each_tracker_are_refused(value: Any) -> None:
    recorder = Recorder(posse.batch("constant"), ["annotations"])
    recorder.reset()
    with pytest.raises(ValueError, match=r"annotation/mood must be numbers of shape \(1, 5\)"):
        recorder.step(np.zeros((1, 5, 2)), {"mood": value})


ANGLES = {"tracker_heading": "tracker_heading", "tracker_fix_heading": "tracker_fix"}
ANGLES |= {"target_heading": "world_heading", "target_frame": "world_frame"}


@pytest.mark.parametrize(
    ("policy", "scenario"),
    [("ddcs-distributed", "field"), ("learned-radio", "radio"), ("planner", "leader-loss"), ("pngl", "robots")],
)
def test_decoded_data_are_the_episode_step_by_step(policy: str, scenario: str) -> None:
    player_of = load(policy)
    settings = posse.get_scenario(scenario, horizon=150)
    recorded = record(policy, settings, seed=5, world=2)
    player = decode(encode(recorded)).players[0]
    batch = batch_for(player_of, settings, seed=5, split="test", first_world=2, autoreset="disabled")
    memory, observations = begin(player_of, batch), batch.reset()
    column, outage = player.columns, round(settings.outage_time / settings.control_step)
    assert player.frames == 151
    for frame in range(151):
        of = {name: array[0] for name, array in batch.state.items()}
        for name in ("x", "y", "fix_x", "fix_y", "sees", "slot", "fix_step"):
            close(column, f"tracker_{name}", frame, of[f"tracker_{name}"])
        for name, unit in ANGLES.items():
            close(column, name, frame, np.arctan2(of[f"{unit}_sin"], of[f"{unit}_cos"]), angle=True)
        for fault in ("sensor_dead", "radio_dead"):
            since = frame - of[f"tracker_{fault}_from"].astype(np.int64)
            close(column, f"tracker_{fault}", frame, (since >= 0) & (since < outage))
        close(column, "tracker_broken", frame, of["tracker_broken_at"] <= frame)
        close(column, "target_x", frame, of["world_x"])
        close(column, "target_y", frame, of["world_y"])
        close(column, "target_dart", frame, of["world_pressed"] < 0)
        close(column, "score", frame, batch.arrays.world["score"][0])
        assert ("heard_step" in column) == (of["heard_step"].size > 0)
        if of["heard_step"].size:
            close(column, "heard_step", frame, of["heard_step"])
        views = batch.layout.views(observations[0])
        for name, value in views.items():
            close(column, f"observation/{name}", frame, value)
        assert ("believed_x" in column) == (scenario == "robots"), "where poses drift"
        if scenario == "robots":
            close(column, "believed_x", frame, views["position"][:, 0])
            close(column, "believed_y", frame, views["position"][:, 1])
            close(column, "believed_heading", frame, np.arctan2(*views["heading"].T[::-1]), angle=True)
        if frame == 150:
            break
        actions, memory = player_of.act(observations, memory)
        close(column, "action", frame, actions[0, :, :2])
        beliefs = player_of.annotations(memory)
        assert {n for n in column if n.startswith("belief/")} == {f"belief/{n}" for n in beliefs}
        for name, value in beliefs.items():
            close(column, f"belief/{name}", frame, value[0])
        observations, _, _, _, infos = batch.step(actions)
        for name in dict(settings.reward_weights):
            close(column, f"reward/{name}", frame + 1, infos[f"reward/{name}"][0])
    for name, value in batch.metrics().items():
        assert player.metrics[name] == pytest.approx(float(value[0]), nan_ok=True)
    for kind, name in (("detection", "detection_time"), ("settled", "settling_time")):
        first = next((event.step * 0.1 for event in player.events if event.kind == kind), np.nan)
        assert first == pytest.approx(player.metrics[name], nan_ok=True)
    broken = [(event.step, *event.robots) for event in player.events if event.kind == "break"]
    assert broken == sorted((row.argmax(), i) for i, row in enumerate(column["tracker_broken"].T) if row.any())
    steps = [event.step for event in player.events]
    assert steps == sorted(steps)


def test_contacts_are_told_with_who_touched_what() -> None:
    """Two trackers run into each other, part, and one runs into the target."""
    batch = posse.batch("constant", 1, num_trackers=2, target_motion="agent", horizon=80)
    recorder = Recorder(batch, RECORD)
    for call in (recorder.trajectory, lambda: recorder.step(np.zeros((1, 3, 2)))):
        with pytest.raises(ResetNeeded, match="its own reset"):
            call()
    recorder.reset(options={"tracker_pose": [(0, 0, 0), (1, 0, np.pi)], "target_pose": (-3, 0, 0)})
    still, ahead, right_about = [-1, 0], [1, 0], [-1, 1]
    for speed, turn, steps in ((ahead, ahead, 8), (right_about, still, 16), (ahead, still, 40)):
        for _ in range(steps):
            recorder.step(np.array([[speed, turn, still]], np.float64))
    played = recorder.trajectory()
    assert played["actions"].dtype == np.float32
    player = replay_of(played, "a").players[0]
    found = [event for event in player.events if event.kind == "contact"]
    assert [(event.robots, event.text) for event in found] == [
        ((0, 1), "contact: tracker 0 and tracker 1, with each other"),
        ((0,), "contact: tracker 0, with the target"),
    ]
    kinds = ("tracker_contacts", "obstacle_contacts", "target_contacts")
    assert [player.metrics[kind] for kind in kinds] == [1, 0, 1]


def test_a_leader_is_whom_more_than_half_follow_and_a_dart_begins_once() -> None:
    frames, n = 6, 4
    states = {
        "world_pressed": np.array([0, 0, -1, -1, 0, 0]),
        "world_step": np.arange(frames),
        "tracker_onsets": np.zeros((frames, n)),
        "tracker_broken_at": np.full((frames, n), 1000),
        **{f"world_{k}_at": np.full(frames, -1) for k in ("detected", "settled", "recovered")},
        **{f"world_contacts_{k}": np.zeros(frames) for k in ("tracker", "obstacle", "target")},
    }
    leader = np.array([[-1, -1, -1, -1], [2, 2, 2, 0], [2, 2, 0, 0], [0, 0, 0, 2], [0, 0, 0, 0], [2, 2, 2, 2]])
    events = find_events({**states, "annotation/leader": leader})
    found = [(event.step, event.kind, event.robots) for event in events]
    assert found == [(2, "dart", ()), (3, "leader", (2, 0)), (5, "leader", (0, 2))]
    assert [event.kind for event in find_events(states)] == ["dart"]


def test_what_is_unknown_or_far_away_comes_back() -> None:
    values = np.array([[np.nan, -1000.0], [0.5, np.nan], [1000.0, 0.0]])
    back = decode(encode(Replay({"a": 1}, (Player("p", {"belief/a": values}),)))).players[0].columns["belief/a"]
    np.testing.assert_allclose(back, values, rtol=0, atol=resolution_of("belief/a", values) * 0.501)
    with pytest.raises(ValueError, match="column 'step' is too great"):
        encode(Replay({"a": 1}, (Player("p", {"step": np.full(2, 2.0**31)}),)))
