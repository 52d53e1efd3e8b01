"""The four tasks: conditions of changes, behaviour, and effects of leaving a change out."""

from typing import Any

import numpy as np
import pytest
from tests.support.drive import complex_of, drive
from tests.support.reference.score import slots

import posse
from posse_baselines import DDCS, play
from posse_baselines.ddcs import CONVERGING, EXCHANGING, FLOCKING, SEARCHING
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.ddcs.settings import NO_EXCHANGE

NO_RETURN = ("exchange>converging", "exchange>flocking")


def metrics(name: str, scenario: str, *forbidden: str) -> dict[str, Any]:
    policy = DDCS(FAMILY[name]).with_settings(forbidden=forbidden)
    return play(posse.batch(scenario, 24, seed=3, split="train", message_size=5), policy)


def test_searching_lasts_until_the_target_is_seen_or_reported() -> None:
    begun_by_hearing = 0
    for now in drive("ddcs-distributed", "search", 40, 60, split="train"):
        knows = now.notes["estimate_age"] >= 0
        np.testing.assert_array_equal(now.notes["task"] != SEARCHING, knows)
        begun_by_hearing += (knows & (np.abs(now.line_of_sight) > 3.0)).sum()
    assert knows.any()
    assert not knows.all()
    assert begun_by_hearing > 0


def test_converging_and_flocking_change_with_hysteresis() -> None:
    settings = FAMILY["ddcs-distributed"]
    wedge = slots(posse.get_scenario("accelerating"))
    begun, before = 0, None
    for now in drive("ddcs-distributed", "accelerating", 20, 250, split="train"):
        task, slot = now.notes["task"], wedge[now.notes["slot"]]
        place = complex_of(now.target)[:, None] + slot * np.exp(1j * now.psi[:, None])
        error = np.abs(place - complex_of(now.tracker))
        assert (error[task == FLOCKING] < settings.far + 0.05).all()
        assert (error[task == CONVERGING] > settings.near - 0.05).all()
        if before is not None:
            begins = (before == CONVERGING) & (task == FLOCKING)
            assert (error[begins] < settings.near + 0.05).all()
            begun += begins.sum()
        before = task
    assert begun >= 20 * 4
    assert (task == FLOCKING).mean() > 0.95


def test_converging_is_at_full_speed_and_flocking_at_the_formations() -> None:
    converging, flocking = [], []
    for step, now in enumerate(drive("pngl-l-phi", "constant", 20, 300, split="train")):
        speed, task = now.commands[..., 0], now.notes["task"]
        if step > 60:  # by then all have turned round
            converging.append(speed[task == CONVERGING])
        if step > 250:
            flocking.append(speed[task == FLOCKING])
    assert np.quantile(np.concatenate(converging), 0.2) > 0.95  # the safeguard slows some
    assert np.median(np.concatenate(flocking)) == pytest.approx(0.6, abs=0.01)


def test_a_straggler_that_is_told_of_the_flock_speeds_up_and_heads_for_it() -> None:
    # Rule iv of section 3.5: it sees neither the target nor its place, and is told by radio.
    pose = [(-1.2, 0.0, 0.0), (-2.05, 0.85, 0.0), (-11.0, 2.0, 0.3)]
    start: dict[str, Any] = {"tracker_pose": pose, "target_pose": (0.0, 0.0, 0.0), "start_distance": (1.0, 12.0)}
    for name, task in (("pngl-l-phi", CONVERGING), ("ddcs-no-radio", SEARCHING)):
        far, speeds = [], []
        for now in drive(name, "constant", 1, 100, num_trackers=3, sensing_range=3.0, **start):
            assert now.notes["task"][0, 2] == task
            far.append(abs(now.line_of_sight[0, 2]))
            speeds.append(now.commands[0, 2, 0])
        if task == CONVERGING:
            assert min(speeds[5:]) > 0.97
            assert far[-1] < far[0] - 0.9 * 0.4 * 10.0  # it gains 0.4 m/s on the flock


def test_a_tracker_that_hears_of_another_leader_holds_the_flocks_course() -> None:
    speeds = []
    for now in drive("pngl-l-phi", "leader-loss", 20, 250, split="train", radio_delay=3):
        exchanging = (now.notes["task"] == EXCHANGING) & ~now.broken
        heading = now.tracker[..., 2] - now.target[:, None, 2]
        on_course = exchanging & (np.abs(np.angle(np.exp(1j * heading))) < 0.1)
        speeds.append(now.commands[on_course, 0])
    held = np.concatenate(speeds)
    assert len(held) > 15
    assert (np.abs(held - 0.6) < 0.02).mean() > 0.85  # the safeguard may slow some


@pytest.mark.parametrize(
    ("name", "scenario", "metric", "forbidden"),
    [
        ("ddcs-distributed", "search", "settling_time", ("searching>converging",)),
        ("pngl-l-phi", "constant", "settling_time", ("converging>flocking",)),
        ("pngl-l-phi", "leader-loss", "recovery_time", NO_EXCHANGE),
        ("pngl-l-phi", "leader-loss", "recovery_time", NO_RETURN),
    ],
)
def test_without_a_transition_the_team_fails(name: str, scenario: str, metric: str, forbidden: tuple[str, ...]) -> None:
    assert np.isfinite(metrics(name, scenario)[metric]).mean() > 0.9
    assert np.isfinite(metrics(name, scenario, *forbidden)[metric]).mean() < 0.5
