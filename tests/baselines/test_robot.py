"""Robots that are given what the trackers of a world measure observe and do the same as those."""

import copy
import json
import math
from collections.abc import Iterator
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

import posse
from posse import Batch, Heard, Robot, TargetFix
from posse_baselines import PolicyError, begin, deploy, load

SCALE = 2.0


def fix_of(record: Any, age: float, frame: bool = True) -> TargetFix:
    psi = math.atan2(record.frame_sin, record.frame_cos) if frame else None
    return TargetFix(record.x / SCALE, record.y / SCALE, math.atan2(record.sin, record.cos), age, psi)


def motion_of(record: Any) -> tuple[float, float, float, float, float]:
    heading = math.atan2(record.heading_sin, record.heading_cos)
    return record.x / SCALE, record.y / SCALE, heading, record.speed / SCALE, record.turn_rate


def heard_by(batch: Batch, i: int) -> Iterator[Heard]:
    """What tracker i of the only world received in this step, from the state."""
    s, arrays, step = batch.scenario, batch.arrays, batch.arrays.world["step"][0]
    delay = s.radio_delay
    for j in range(s.num_trackers):
        if j == i:
            continue
        t, said = arrays.tracker[0, j], arrays.message[0, 0, j]
        if not s.perfect_radio:
            if step < delay or arrays.heard[0, i, j]["step"] != step - delay:
                continue
            t, said = arrays.broadcast[0, (step - delay) % (delay + 1), j], arrays.heard_message[0, i, j]
        fix = fix_of(t.fix, (step - delay - t.fix_step) * s.control_step) if t.fix_step >= 0 else None
        yield Heard(j, *motion_of(t), said, fix, delay * s.control_step)


@pytest.mark.parametrize(
    ("scenario", "policy", "frame"),
    [
        ("smart", "pngl-l-phi", False),  # it always sees the target, and estimates ψ itself
        ("radio", "ddcs-tuned", True),
        ("field", "learned-field", True),
        ("search", "corrected-smart", True),
    ],
)
def test_robots_observe_and_do_what_trackers_do(scenario: str, policy: str, frame: bool) -> None:
    team = load(policy)
    batch = posse.batch(scenario, message_size=team.message_size, seed=5, horizon=250)
    s = batch.scenario
    robots = [deploy(team, Robot(s, i, scale=SCALE)) for i in range(s.num_trackers)]
    observations, memory, alike = batch.reset(), begin(team, batch), []
    told_before = [(0.0,) * s.message_size] * s.num_trackers
    for _ in range(120):
        actions, memory = team.act(observations, memory)
        sonar = batch.layout.views(observations[0])["sonar"]
        for i, robot in enumerate(robots):
            t = batch.arrays.tracker[0, i]
            if not batch.working[0, i]:
                continue
            x, y, heading, speed, turn_rate = motion_of(t)
            seen = fix_of(t.fix, 0.0, frame) if t.sees else None
            command = robot.step(
                (x, y, heading), speed, turn_rate, seen, sonar[i] / SCALE, heard_by(batch, i), touching=bool(t.touching)
            )
            np.testing.assert_allclose(robot.row, observations[0, i], rtol=1e-4, atol=1e-4)
            forward = 2 * command.speed * SCALE / s.tracker_speeds[i] - 1
            told = forward, command.turn_rate / s.tracker_turn_rates[i], *command.message
            np.testing.assert_allclose(told[2:], actions[0, i, 2:], atol=1e-4)
            alike.append(np.allclose(told, actions[0, i], atol=1e-4))
            said, step = robot.robot.broadcast(), batch.arrays.world["step"][0]
            assert (said.number, said.message) == (i, told_before[i]), "the message that led to the pose"
            told_before[i] = command.message
            assert said[1:6] == pytest.approx(motion_of(t))
            if not s.perfect_radio:  # which has no record of what is sent, before anything is heard
                sent = batch.arrays.broadcast[0, step % (s.radio_delay + 1), i]
                assert (said.fix is None) == (sent.fix_step < 0)
                if said.fix is not None:
                    age = (step - sent.fix_step) * s.control_step
                    assert said.fix == pytest.approx(fix_of(sent.fix, age), abs=1e-4)
        observations = batch.step(actions)[0]
    # Where a script drives along a tangent, rounding decides between two commands, and the next ones follow from it.
    assert np.mean(alike) > 0.97


def test_what_is_older_than_the_first_observation_counts_as_of_then() -> None:
    robot, ages = Robot("constant", 0), []
    for k in range(6):
        robot = copy.deepcopy(robot) if k == 3 else robot  # which goes on as the first
        row = robot.observe((0.0, 0.0, 0.0), 0.0, 0.0, TargetFix(3.0, 0.0, 0.0, age=0.3))
        ages.append(float(robot.layout.views(row)["target_age"]))
        told = robot.broadcast().fix
        assert told is not None
        assert told.age == pytest.approx(0.3), "team-mates are told the true age"
    assert ages == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.3, 0.3])
    for _ in range(robot.scenario.horizon):
        row = robot.observe((0.0, 0.0, 0.0), 0.0, 0.0)
    assert robot.layout.views(row)["time_left"] == 0.0  # it may go on longer than an episode


@pytest.mark.parametrize("order", [1, -1])
def test_of_what_is_older_the_newest_is_taken(order: int) -> None:
    robot = Robot("constant", 0, radio_delay=30)
    old, new = (TargetFix(x, 0.0, 0.0, age) for x, age in ((9.0, 1.0), (2.0, 0.1)))
    ages = ((old, 0.14), (new, 0.1))  # of one step
    told = [Heard(1, 10 * fix.x, 0.0, 0.0, 0.0, 0.0, fix=fix, age=age) for fix, age in ages][::order]
    received = [Heard(*each) for each in json.loads(json.dumps(told))]
    older = Heard(1, 90.0, 0.0, 0.0, 0.0, 0.0, fix=old, age=2.0)
    for fix, heard in ((old, received), (None, [older])):
        v = robot.layout.views(robot.observe((0.0, 0.0, 0.0), 0.0, 0.0, fix, heard=heard))
        assert [*v["target_range"].flat, v["neighbour_range"][0]] == [2.0, 20.0]
    assert np.isfinite(v["target_velocity"]).all()


@pytest.mark.parametrize(("phase", "jitter"), [(0.02, 0.0), (0.0, 0.02)])  # s
def test_ages_and_velocity_of_a_lost_target_stay_right_whenever_each_robot_steps(phase: float, jitter: float) -> None:
    robots, seen = [Robot("constant", i, radio_delay=1) for i in range(5)], 5.0
    sent: list[tuple[float, Heard]] = []
    late = np.random.default_rng(3).uniform(-jitter, jitter, (80, 5))
    for time, i in sorted((0.1 * k + phase * i + late[k, i], i) for k in range(80) for i in range(5)):
        fix = TargetFix(0.6 * time, 0.0, 0.0) if i == 0 and time < seen else None
        heard = [m._replace(age=time - at) for at, m in sent if m.number != i and 0.015 <= time - at < 0.115]
        v = robots[i].layout.views(robots[i].observe((0.0, 0.0, 0.0), 0.0, 0.0, fix, heard=heard))
        sent.append((time, robots[i].broadcast()))
        if time > seen + 1.0:
            assert v["target_age"] == pytest.approx(time - (seen - 0.1), abs=0.1 + jitter)  # whole steps
            assert v["target_velocity"][0] == pytest.approx(0.6, abs=0.02 + 12 * jitter)  # over 0.1 s +- 2 jitter


def test_a_robot_drives_where_no_start_of_the_scenario_fits() -> None:
    assert Robot("constant", 0, arena=4.0).observe((0.0, 0.0, 0.0), 0.0, 0.0).shape == (posse.batch().layout.size,)


def test_commands_leave_room_for_the_turn() -> None:
    command = Robot("robots", 0, scale=2.0).command((1.0, 1.0))
    assert 2.0 * command.speed + 0.287 / 2 * command.turn_rate == pytest.approx(0.26)


def test_a_radio_that_is_later_than_the_scenarios_is_told() -> None:
    for delay, late in ((1, 0.1), (1, 0.2), (2, 0.2)):
        robot, heard = Robot("constant", 0, radio_delay=delay), Heard(1, 0.0, 0.0, 0.0, 0.0, 0.0, age=late)
        wanted = pytest.warns(UserWarning, match="messages arrive later than radio_delay=1 steps")
        with wanted if late > 0.1 * delay else nullcontext():
            robot.observe((0.0, 0.0, 0.0), 0.0, 0.0, heard=[heard])


def test_a_pose_that_no_robot_of_the_scenario_reaches_is_told() -> None:
    with pytest.warns(UserWarning, match="'obstacles' reaches 10 m from its middle"):
        Robot("obstacles", 0).observe((11.0, 0.0, 0.0), 0.0, 0.0)


def test_invalid_measurements_are_refused() -> None:
    robot = Robot("field", 1)
    beams = robot.scenario.sonar_beams
    with pytest.raises(ValueError, match="before the first observation"):
        robot.broadcast()
    before = robot.observe((0.0, 0.0, 0.0), 0.1, 0.0)
    for measured, words in (
        (((0.0, math.nan, 0.0), 0.0, 0.0), "pose"),
        (((0.0, 1e200, 0.0), 0.0, 0.0), r"pose=.* between -1e\+06 and 1e\+06"),
        (((0.0, 0.0, 0.0), math.inf, 0.0), "speed"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, TargetFix(0.0, 0.0, math.nan)), "fix"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, TargetFix(0.0, 0.0, 0.0, -1.0)), "age=-1.0"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, None, None, [Heard(0, 0.0, 0.0, 0.0, 0.0, 0.0, age=math.nan)]), "age=nan"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, None, None, [(0, 0, 0, 0, 0, 0, (), None, None)]), "age=None"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, None, None, [(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5)]), "a message of 1"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, None, None, [(0, 0, 0, 0, 0, 0, (), None, 10**400)]), r"age=10+\.* must be"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, 1.0), "fix=1.0 must be"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, None, [1.0]), f"{beams} distances"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, None, ["1"] * beams), "sonar"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, None, None, Heard(0, 0.0, 0.0, 0.0, 0.0, 0.0)), "give a list of posse.Heard"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, None, None, [Heard(1, 0.0, 0.0, 0.0, 0.0, 0.0)]), "no team-mate"),
        (((0.0, 0.0, 0.0), 0.0, 0.0, None, None, [Heard(0, 0.0, 0.0, 0.0, 0.0, 0.0, (1.0,))]), "wanted 0 numbers"),
    ):
        with pytest.raises(ValueError, match=words):
            robot.observe(*measured)
    with pytest.raises(ValueError, match="touching"):
        robot.observe((3.0, 0.0, 0.0), 0.0, 0.0, touching=np.array([0, 1]))  # type: ignore[arg-type]
    assert robot.steps == 0
    robot.reset()
    np.testing.assert_array_equal(robot.observe((0.0, 0.0, 0.0), 0.1, 0.0), before)
    with pytest.raises(ValueError, match=r"\[-1, 1\]"):
        robot.command((0.0, 1.5))
    for number in (9, 1.5):
        with pytest.raises(ValueError, match=f"number={number}"):
            Robot("field", number)  # type: ignore[arg-type]
    for scale in (0, 1e300, np.complex64(1)):
        with pytest.raises(ValueError, match=r"scale=.* must be from 0\.001 to 1000"):
            Robot("field", 0, scale=scale)  # type: ignore[arg-type]
    with pytest.raises(PolicyError, match="reads the state"):
        deploy(load("planner"), robot)
