"""The batch: determinism, replays, resets, saving, copies, and returned arrays that never change."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from gymnasium.error import ResetNeeded
from tests.support.attack import out_of_band, same
from tests.support.process import printed
from tests.support.reference.state import snapshot

import posse


def actions_for(batch: posse.Batch, step: int) -> npt.NDArray[np.float32]:
    """Return actions that depend on the step alone."""
    return np.random.default_rng(step).uniform(-1, 1, batch.action_shape).astype(np.float32)


def play(batch: posse.Batch, steps: int) -> list[npt.NDArray[Any]]:
    """Return all outputs of a batch over a number of steps."""
    out: list[npt.NDArray[Any]] = [batch.reset()]
    for step in range(steps):
        observations, rewards, terminated, truncated, infos = batch.step(actions_for(batch, step))
        out += [observations, rewards, terminated, truncated, infos["score"]]
    return out


def test_the_number_of_threads_changes_nothing() -> None:
    whole = play(posse.batch("field", 700, seed=3, num_threads=1), 40)
    for threads in (2, 3, 7):
        assert same(play(posse.batch("field", 700, seed=3, num_threads=threads), 40), whole)


def test_seed_split_and_episode_each_make_other_worlds() -> None:
    splits = ("train", "validation", "test")
    batches = [posse.batch("constant", 50, seed=seed, split=split) for seed in (0, 1) for split in splits]
    starts = [*(batch.reset() for batch in batches), batches[0].reset()]
    places = np.concatenate([start[:, 0, :10] for start in starts])
    assert len(np.unique(places, axis=0)) == len(places), "no world comes twice"


def test_steps_of_trackers_are_counted_where_float32_rounds() -> None:
    batch = played("constant", steps=0)
    batch.arrays.world["tracker_steps"] = 2**24
    batch.step(actions_for(batch, 0))
    assert batch.state["world_tracker_steps"].tolist() == [2**24 + 5] * 3


@pytest.mark.parametrize("name", ["smart", "leader-loss", "field", "robots"])
def test_a_batch_is_saved_and_restored_in_mid_episode(name: str) -> None:
    batch = posse.batch(name, 3, seed=6, message_size=1)
    batch.reset()
    for step in range(25):
        now = batch.step(actions_for(batch, step))[0]

    def onward(batch: posse.Batch) -> list[npt.NDArray[Any]]:
        return [batch.step(actions_for(batch, step))[0] for step in range(25, 60)]

    saved, expected = batch.save(), onward(batch)
    fresh = posse.batch(name, 3, message_size=1)
    for into, back in ((batch, saved), (batch, out_of_band(saved)), (fresh, saved)):
        np.testing.assert_array_equal(into.restore(back), now)
        assert same(onward(into), expected)
    for other in (posse.batch(name, 2, message_size=1), posse.batch(name, 3)):
        with pytest.raises(ValueError, match="does not fit"):
            other.restore(saved)


IN_ANOTHER_PROCESS = """
import sys
import numpy as np
from tests.envs.engine.test_batch import here

np.savez(sys.argv[3], *here(sys.argv[1], int(sys.argv[2])))
"""


# Eight worlds together and one alone: of the largest whole team, of one of which a few are chosen,
# and of one of which many are; two of the largest teams, by radio and among all that there can be.
LARGEST: dict[str, Any] = {"num_trackers": 64, "num_neighbours": 63, "start_distance": (4.0, 40.0)}
PLACE: dict[str, Any] = {"arena": 100.0, "num_obstacles": 60, "obstacle_gap": 0.3, "sonar_beams": 64}
TEAMS: dict[str, tuple[int, dict[str, Any]]] = {
    "smart": (9, {"num_trackers": 16, "num_neighbours": 15}),
    "constant": (9, {"num_trackers": 10, "num_neighbours": 3}),
    "search": (9, {"num_trackers": 11, "num_neighbours": 9}),
    "radio": (1, {**LARGEST, "radio_range": 30.0}),
    "duel": (1, {**LARGEST, **PLACE, "target_motion": "agent"}),
}


def here(name: str, steps: int) -> list[npt.NDArray[Any]]:
    make: dict[str, Any] = {"seed": 11, "horizon": 25, "message_size": 1, "settle_time": 1.0}
    worlds, team = TEAMS.get(name, (2, {}))
    results = play(batch := posse.batch(name, worlds, **{**make, **team}), steps)
    return [*results, batch.copies(2).state["tracker_broken_at"]]


LONG = (("accelerating", 30), ("constant", 3), ("search", 3), ("radio", 1), ("duel", 1))


@pytest.mark.parametrize(
    ("name", "steps"), [("field", 30), ("smart", 3), *(pytest.param(*each, marks=pytest.mark.long) for each in LONG)]
)
def test_uncompiled_worlds_are_the_same_to_rounding(name: str, steps: int, tmp_path: Path) -> None:
    """For 30 steps, a new episode among them; and no index is out of bounds, which numpy sees."""
    out = tmp_path / "out.npz"
    printed("-W", "error", "-c", IN_ANOTHER_PROCESS, name, str(steps), out, NUMBA_DISABLE_JIT="1")
    with np.load(out) as plain:
        for mine, theirs in zip(here(name, steps), plain.values(), strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=1e-4, atol=1e-3)


DRAWS = ("accelerating", "radio", "leader-loss", "field")


def played(name: str, worlds: int = 3, steps: int = 40, **overrides: Any) -> posse.Batch:
    near: dict[str, Any] = {"start_distance": (1.5, 4.0)}
    batch = posse.batch(name, worlds, seed=4, **{**near, **overrides})
    batch.reset()
    for step in range(steps):
        batch.step(actions_for(batch, step))
    return batch


def repeated(batch: posse.Batch, step: int) -> npt.NDArray[np.float32]:
    """Return the actions of a batch for two copies of it."""
    return np.repeat(actions_for(batch, step), 2, axis=0)


@pytest.mark.parametrize("name", ["constant", "smart", "obstacles", *DRAWS])
def test_copies_draw_what_neither_their_original_nor_other_copies_draw(name: str) -> None:
    """And go on as their originals where nothing is drawn."""
    batch = played(name)
    copies = batch.copies(2)
    np.testing.assert_array_equal(copies.observe(), np.repeat(batch.observe(), 2, axis=0))
    seen, own = [], []
    for step in range(100, 500 if name == "leader-loss" else 130):
        seen.append(copies.step(repeated(batch, step))[0])
        own.append(batch.step(actions_for(batch, step))[0])
    first, second, original = np.stack(seen)[:, ::2], np.stack(seen)[:, 1::2], np.stack(own)
    for one, other in ((first, original), (second, original), (first, second)):
        assert ((one != other).any(axis=(0, 2, 3)) == (name in DRAWS)).all()


def test_what_copies_draw_follows_from_seed_and_step() -> None:
    def future(seed: int, steps: int = 40, into: posse.Batch | None = None) -> npt.NDArray[np.float32]:
        batch = played("field", steps=steps)
        copies = batch.copies(2, seed=seed, into=into)
        for step in range(20):
            seen = copies.step(repeated(batch, step))[0]
        return seen

    np.testing.assert_array_equal(future(1), future(1, into=played("field", 6)))
    assert not np.array_equal(future(1), future(2))


def test_the_episode_after_a_copy_s_end_is_no_world_s() -> None:
    batch = played("constant", 2, steps=9, horizon=10, settle_time=0.5, clip_actions=True)
    copies = batch.copies(2)
    for step in range(2):
        batch.step(actions_for(batch, step))
        copies.step(9 * repeated(batch, step))
    assert (copies.arrays.world["step"] == 0).all()
    assert len({*batch.arrays.world["x"].tolist(), *copies.arrays.world["x"].tolist()}) == 6


def test_copies_go_on_where_the_worlds_that_they_replace_are_over() -> None:
    settings: dict[str, Any] = {"horizon": 10, "settle_time": 0.5, "autoreset": "disabled"}
    over, batch = (played("constant", 3, steps=steps, **settings) for steps in (10, 9))
    with pytest.raises(ResetNeeded, match="world 0 and 2 more"):
        over.step(actions_for(over, 0))
    batch.copies(1, into=over).step(actions_for(batch, 0))


def test_faults_that_have_begun_stay_and_others_are_drawn_anew() -> None:
    batch = played("field", 200, steps=300)
    copies = batch.copies(20)
    own, theirs = snapshot(batch), snapshot(copies)
    for name in ("tracker_sensor_dead_from", "tracker_radio_dead_from"):
        begun = np.repeat(own[name] <= 300, 20, axis=0)
        np.testing.assert_array_equal(theirs[name][begun], np.repeat(own[name], 20, axis=0)[begun])
        coming = theirs[name][~begun]
        assert not np.array_equal(coming, np.repeat(own[name], 20, axis=0)[~begun])
        assert (coming > 300).all()
        # A fifth has an outage at a uniform step of 600; of those with none by 300, a ninth.
        assert (coming < 600).mean() == pytest.approx(1 / 9, abs=0.015)
        assert coming[coming < 600].mean() == pytest.approx(450, abs=10)
    for name in ("tracker_broken_at", "world_breaks_left"):
        np.testing.assert_array_equal(theirs[name], np.repeat(own[name], 20, axis=0))
