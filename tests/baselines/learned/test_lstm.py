"""A recurrent network's memory: kept, restarted, saved and pickled with the policy's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.adapters import out_of_band
from tests.support.learned import network_for, policy_for

import posse
from posse_baselines import Policy, PolicyError, load, play
from posse_baselines.learned import LSTM, Encoder, Encoding, LearnedPolicy
from posse_baselines.learned.advice import Advising, check_adviser
from posse_baselines.learned.policy_file import read_policy_file, write_policy_file

CELLS = 12
WORLDS = 4


def recurrent(scenario: str = "field", **changes: Any) -> LearnedPolicy:
    layout = posse.ObservationLayout(posse.get_scenario(scenario))
    return policy_for(layout, cells=CELLS, **changes)


def seen(scenario: str = "field", steps: int = 8, worlds: int = WORLDS) -> list[Any]:
    """Observations of some steps."""
    batch = posse.batch(scenario, worlds, seed=3)
    generator = np.random.default_rng(0)
    first = batch.reset()
    chosen = generator.uniform(-1, 1, (steps - 1, *batch.action_shape))
    return [first, *(batch.step(actions)[0] for actions in chosen)]


def layout_of(scenario: str = "field") -> posse.ObservationLayout:
    return posse.ObservationLayout(posse.get_scenario(scenario))


def acts(policy: Policy, observations: list[Any], memory: Any) -> list[Any]:
    done = []
    for each in observations:
        actions, memory = policy.act(each, memory)
        done.append(actions)
    return done


@pytest.mark.parametrize("output", ["clip", "tanh"])
def test_compiled_and_plain_agree_over_an_episode_and_its_restart(output: str) -> None:
    policy = recurrent(output=output)
    memory = policy.begin(layout_of(), WORLDS)
    encoder = Encoder(policy.encoding, layout_of())
    states = policy.network.fresh(WORLDS, 5)
    for step, observations in enumerate(seen(steps=12)):
        if step == 7:
            mask = np.array([True, False, False, True])
            memory = policy.restart(memory, mask)
            states[mask] = 0
        actions, memory = policy.act(observations, memory)
        rows = encoder.encode(observations).reshape(WORLDS, 5, -1)
        expected, states = policy.network.step(rows, states)
        np.testing.assert_allclose(actions, expected, atol=3e-5)
        np.testing.assert_allclose(policy.arrays(memory)["lstm"], states, atol=3e-5)
    assert np.ptp(actions) > 0.5


def test_it_remembers() -> None:
    policy = recurrent()
    now = seen()[-1]
    fresh, _ = policy.act(now, policy.begin(layout_of(), WORLDS))
    later = acts(policy, seen(), policy.begin(layout_of(), WORLDS))[-1]
    assert np.abs(fresh - later).max() > 0.03


def test_a_world_plays_alike_alone_and_in_a_batch() -> None:
    policy, rows = recurrent(), seen(worlds=600)
    together = acts(policy, rows, policy.begin(layout_of(), 600))
    alone = acts(policy, [each[433:434] for each in rows], policy.begin(layout_of(), 1))
    for many, one in zip(together, alone, strict=True):
        np.testing.assert_array_equal(many[433], one[0])


def test_a_restarted_world_plays_as_a_new_one_and_the_others_go_on() -> None:
    policy, rows = recurrent(), seen()
    first = acts(policy, rows, policy.begin(layout_of(), WORLDS))
    memory = policy.begin(layout_of(), WORLDS)
    acts(policy, rows, memory)
    memory = policy.restart(memory, np.array([False, True, False, False]))
    again = acts(policy, rows, memory)
    for before, after in zip(first, again, strict=True):
        np.testing.assert_array_equal(before[1], after[1])
    assert not np.array_equal(first[0][0], again[0][0])


def test_a_memory_that_was_pickled_out_of_band_goes_on_alike() -> None:
    policy, rows = recurrent(), seen()
    memory = policy.begin(layout_of(), WORLDS)
    acts(policy, rows, memory)
    copy, other = out_of_band((policy, memory))
    mask = np.array([True, False, False, False])
    mine = acts(policy, rows, policy.restart(memory, mask))
    theirs = acts(copy, rows, copy.restart(other, mask))
    for a, b in zip(mine, theirs, strict=True):
        np.testing.assert_array_equal(a, b)


def test_arrays_give_the_memory_back() -> None:
    policy, rows = recurrent(), seen()
    memory = policy.begin(layout_of(), WORLDS)
    acts(policy, rows, memory)
    kept = {name: array.copy() for name, array in policy.arrays(memory).items()}
    mine = acts(policy, rows, memory)
    other = policy.begin(layout_of(), WORLDS)
    for name, array in policy.arrays(other).items():
        array[...] = kept[name]
    for a, b in zip(mine, acts(policy, rows, other), strict=True):
        np.testing.assert_array_equal(a, b)


def test_network_and_adviser_remember_side_by_side() -> None:
    adviser = check_adviser("ddcs-distributed", load("ddcs-distributed"))
    batch = posse.batch("field", WORLDS, message_size=adviser.message_size, horizon=60)
    encoding = Encoding.of(batch.layout, "slots")
    network = network_for(encoding.size + Advising(adviser).inputs, cells=CELLS)
    policy = LearnedPolicy(network, encoding, {}, adviser)
    arrays = policy.arrays(policy.begin(batch.layout, WORLDS))
    assert arrays["lstm"].shape == (WORLDS, 5, 2, CELLS)
    assert len(arrays) == 1 + len(adviser.arrays(adviser.begin(batch.layout, WORLDS)))
    rows = [batch.reset(seed=1)]
    memory = policy.begin(batch.layout, WORLDS)
    for _ in range(5):
        actions, memory = policy.act(rows[-1], memory)
        rows.append(batch.step(actions)[0])
    again = policy.restart(memory, np.ones(WORLDS, np.bool_))
    for k, actions in enumerate(acts(policy, rows[:5], again)):
        fresh = acts(policy, rows[: k + 1], policy.begin(batch.layout, WORLDS))[-1]
        np.testing.assert_array_equal(actions, fresh)


def test_a_target_remembers_too() -> None:
    scenario = posse.get_scenario("duel", target_motion="agent")
    layout = posse.ObservationLayout(scenario)
    encoding = Encoding.of(layout, "plain")
    network = network_for(encoding.size, cells=CELLS)
    policy = LearnedPolicy(network, encoding, {"side": "target"})
    memory = policy.begin(layout, WORLDS)
    assert policy.arrays(memory)["lstm"].shape == (WORLDS, 1, 2, CELLS)
    row = np.zeros((WORLDS, 1, layout.size), np.float32)
    first, memory = policy.act(row, memory)
    second, memory = policy.act(row, memory)
    assert first.shape == (WORLDS, 1, 2)
    assert not np.array_equal(first, second)


def test_a_file_gives_back_the_policy(tmp_path: Path) -> None:
    policy, path = recurrent(), tmp_path / "mine.safetensors"
    policy.save(path)
    assert read_policy_file(path)[1]["format"] == 3
    again = LearnedPolicy.from_file(path)
    mine, theirs = (play(posse.batch("field", 3, horizon=60), each) for each in (policy, again))
    np.testing.assert_array_equal(mine["score"], theirs["score"])


def test_files_without_a_memory_keep_the_format_that_older_versions_read(tmp_path: Path) -> None:
    policy_for(layout_of()).save(tmp_path / "mine.safetensors")
    description = read_policy_file(tmp_path / "mine.safetensors")[1]
    assert description["format"] == 1
    assert "memory" not in description


TENSORS = recurrent().network.tensors()


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("lstm.biases", np.float32(0), "damaged"),
        ("lstm.biases", np.zeros(3, np.float32), "an LSTM of shapes"),
        ("lstm.biases", np.zeros(4 * CELLS + 1, np.float32), "an LSTM of shapes"),
        ("lstm.biases", np.full(4 * CELLS, np.nan, np.float32), "finite float32"),
        ("lstm.biases", np.zeros(4 * CELLS + 4, np.float32), "an LSTM of shapes"),
        ("lstm.input_weights", TENSORS["lstm.input_weights"][:, 1:].copy(), "an LSTM of shapes"),
        ("lstm.input_weights", TENSORS["lstm.input_weights"].reshape(-1), "an LSTM of shapes"),
        ("lstm.memory_weights", TENSORS["lstm.memory_weights"].T.copy(), "an LSTM of shapes"),
        ("lstm.memory_weights", TENSORS["lstm.memory_weights"].astype(np.float64), "float32"),
        ("lstm.memory_weights", np.full((4 * CELLS, CELLS), 3e38, np.float32), "can overflow"),
        ("layers.0.weight", np.zeros((24, CELLS + 1), np.float32), "does not follow"),
    ],
)
def test_arrays_that_make_no_network(tmp_path: Path, name: str, array: Any, message: str) -> None:
    path = tmp_path / "mine.safetensors"
    recurrent().save(path)
    description = read_policy_file(path)[1]
    write_policy_file(path, {**TENSORS, name: np.asarray(array)}, description)
    with pytest.raises(PolicyError, match=message):
        LearnedPolicy.from_file(path)


@pytest.mark.parametrize("missing", ["input_weights", "memory_weights", "biases"])
def test_a_file_without_an_array(tmp_path: Path, missing: str) -> None:
    path = tmp_path / "mine.safetensors"
    recurrent().save(path)
    description = read_policy_file(path)[1]
    tensors = {name: array for name, array in TENSORS.items() if name != f"lstm.{missing}"}
    write_policy_file(path, tensors, description)
    with pytest.raises(PolicyError, match=f"damaged: KeyError.*{missing}"):
        LearnedPolicy.from_file(path)


def test_large_gates_give_no_warning_and_stay_finite() -> None:
    wide = LSTM(*(np.full(s, 1e30, np.float32) for s in ((4, 1), (4, 1), (4,))))
    states = wide.step(np.ones((1, 1), np.float32), np.zeros((1, 2, 1), np.float32))
    np.testing.assert_allclose(states[0, :, 0], [np.tanh(1.0), 1.0], rtol=1e-6)
