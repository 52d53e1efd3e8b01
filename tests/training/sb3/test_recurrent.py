"""Recurrent PPO: what is learned from is what was played, and what is exported plays alike."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3.common.callbacks import BaseCallback
from tests.support.runs import BELIEVING, HORIZON, small

from posse_training.runs.models import make_adviser, make_env, make_model
from posse_training.runs.saved.export import export
from posse_training.runs.train import torch_threads
from posse_training.sb3.policies import from_sb3
from posse_training.sb3.recurrent import SequenceBuffer


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    with torch_threads(1):
        yield


class Halt(BaseCallback):
    """Stops before networks learn from the rollout."""

    def _on_rollout_end(self) -> None:
        self.model.train = lambda: None  # type: ignore[attr-defined]

    def _on_step(self) -> bool:
        return True


def played(tmp_path: Path, rollouts: int = 3, **changes: Any) -> Any:
    """A model whose buffer holds a rollout that it has not learned from."""
    settings = small(tmp_path, "recurrent-ppo", **changes)
    env = make_env(settings)
    model = make_model(settings, env)
    model.learn(rollouts * env.num_envs * settings.rollout, callback=Halt())
    return model


def test_sequences_evaluate_to_what_was_recorded(tmp_path: Path) -> None:
    """The states at their start are right, wherever in a rollout an episode begins."""
    model = played(tmp_path)
    buffer = model.rollout_buffer
    assert isinstance(buffer, SequenceBuffer)
    assert buffer.episode_starts[1:].any()
    assert 0 < buffer.episode_starts[0].sum() < model.n_envs
    assert all(state.abs().max() > 0.01 for pair in buffer.first_states or () for state in pair)
    for batch in buffer.get(64):
        there = batch.mask > 0
        with torch.no_grad():
            values, log_probs, _ = model.policy.evaluate_actions(
                batch.observations, batch.actions, batch.lstm_states, batch.episode_starts
            )
        torch.testing.assert_close(values.flatten()[there], batch.old_values[there])
        torch.testing.assert_close(log_probs[there], batch.old_log_prob[there])


@pytest.mark.parametrize("batch_size", [1, 40, 64, None])
def test_each_step_occurs_once_a_pass(tmp_path: Path, batch_size: int | None) -> None:
    buffer = played(tmp_path).rollout_buffer
    buffer.advantages[...] = np.arange(buffer.advantages.size).reshape(buffer.advantages.shape)
    batches = list(buffer.get(batch_size))
    seen = np.concatenate([b.advantages[b.mask > 0].numpy() for b in batches])
    np.testing.assert_array_equal(np.sort(seen), np.arange(buffer.advantages.size))
    assert len(batches) == {1: 8, 40: 4, 64: 3, None: 1}[batch_size]
    for batch in batches:
        assert not batch.old_log_prob[batch.mask == 0].any()
        assert not batch.episode_starts.any()


def test_an_episode_that_begins_with_the_rollout_forgets(tmp_path: Path) -> None:
    buffer = played(tmp_path).rollout_buffer
    buffer.episode_starts[...] = 0
    buffer.episode_starts[0, 2:5] = 1
    (batch,) = buffer.get()
    forgotten = (batch.lstm_states.pi[0].abs().amax(dim=(0, 2)) == 0).sum()
    assert forgotten == 3


def test_an_incomplete_rollout_is_refused(tmp_path: Path) -> None:
    model = played(tmp_path)
    model.rollout_buffer.reset()
    with pytest.raises(RuntimeError, match="must be complete"):
        next(model.rollout_buffer.get())


def test_a_model_of_sb3_contrib_remembers_as_its_export_does(tmp_path: Path) -> None:
    settings = small(tmp_path, "recurrent-ppo")
    env = make_env(settings)
    model = make_model(settings, env)
    observations = env.batches[0].reset()
    steps = [observations, *(env.batches[0].step(np.zeros((4, 2, 2)))[0] for _ in range(5))]
    taken = []
    for policy in (export(model, env.encoding, {}), from_sb3(model, encoding=env.encoding)):
        memory = policy.begin(env.batches[0].layout, 4)
        for row in steps:
            _, memory = policy.act(row, memory)
        memory = policy.restart(memory, np.array([False, True, False, True]))
        taken.append(policy.act(steps[2], memory)[0])
        fresh = policy.act(steps[2], policy.begin(env.batches[0].layout, 4))[0]
        np.testing.assert_allclose(taken[-1][[1, 3]], fresh[[1, 3]], atol=1e-6)
        assert np.abs(taken[-1][[0, 2]] - fresh[[0, 2]]).max() > 1e-5
    np.testing.assert_allclose(taken[0], taken[1], atol=1e-5)


@pytest.mark.parametrize("changes", [{}, {"encoding": "plain"}, BELIEVING])
def test_what_is_exported_plays_as_the_model_does_through_episodes(tmp_path: Path, changes: dict[str, Any]) -> None:
    settings = small(tmp_path, "recurrent-ppo", steps=160, **changes)
    env = make_env(settings)
    model: Any = make_model(settings, env)
    torch.manual_seed(0)
    torch.nn.init.normal_(model.policy.action_net.weight, std=0.1)
    policy = export(model, env.encoding, {}, make_adviser(settings), settings.correction)
    observations: Any = env.reset()
    memory = policy.begin(env.batches[0].layout, settings.num_worlds)
    states, begins = None, np.ones(env.num_envs, np.bool_)
    restarts = 0
    for _ in range(HORIZON + 5):
        chosen, states = model.predict(observations, states, begins, deterministic=True)
        inputs = np.asarray(observations).reshape(settings.num_worlds, -1, env.observation_size)
        rows, memory.states = policy.network.step(inputs, memory.states)
        np.testing.assert_allclose(rows.reshape(chosen.shape), chosen, atol=1e-5)
        torch_states = np.stack([state[0] for state in states], axis=1)
        mine = memory.states.reshape(torch_states.shape)
        np.testing.assert_allclose(mine, torch_states, atol=1e-5)
        observations, _, begins, _ = env.step(chosen)
        ended = begins.reshape(settings.num_worlds, -1)[:, 0]
        memory = policy.restart(memory, ended)
        restarts += int(ended.sum())
    assert restarts >= settings.num_worlds
