"""The worlds and the untrained model of a training run."""

from __future__ import annotations

from functools import partial
from typing import Any, Final

import numpy as np
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise
from torch import nn

from posse_baselines import load
from posse_baselines.learned.advice import Adviser, Advising, check_adviser
from posse_training.runs.settings import TrainSettings
from posse_training.runs.sides import encoding_of, make_batches
from posse_training.sb3.centralized_critic import CentralizedCriticPolicy
from posse_training.sb3.normalisation import Normaliser
from posse_training.sb3.speedups import FlatRolloutBuffer, QuickTanh
from posse_training.sb3.vec_env import TeamVecEnv

_ACTIVATIONS: Final[dict[str, type[nn.Module]]] = {"tanh": QuickTanh, "relu": nn.ReLU}
_ADAM_EPSILON: Final = 1e-5  # the default of stable-baselines3's PPO
_EXPLORATION: Final = 0.1  # standard deviation of the noise on td3's actions
_ENTROPY: Final = "auto_0.01"  # of sac: from 1, rewards of 0.1 a step count for nothing at first


def make_env(settings: TrainSettings, num_threads: int | None = None) -> TeamVecEnv:
    """Return the training worlds, of the split ``"train"``, stepped by so many threads."""
    batches = make_batches(settings, num_threads)
    encoding = encoding_of(settings, batches)
    adviser = make_adviser(settings)
    return TeamVecEnv(
        batches,
        encoding,
        advising=(Advising(adviser, settings.correction, believes=encoding.believes) if adviser else None),
        see_state=settings.algorithm == "mappo",
    )


def make_adviser(settings: TrainSettings) -> Adviser | None:
    """Return the adviser of a run, if any.

    Raises:
        PolicyError: A policy that cannot be an adviser.
    """
    if settings.advise is None:
        return None
    return check_adviser(
        settings.advise, load(settings.advise), settings.correction, believes=settings.encoding == "belief"
    )


def make_model(settings: TrainSettings, env: TeamVecEnv) -> BaseAlgorithm:
    """Return an untrained model."""
    network: dict[str, Any] = {
        "activation_fn": _ACTIVATIONS[settings.activation],
        "features_extractor_class": Normaliser,
        "optimizer_kwargs": {"fused": True},
    }
    if settings.on_policy:
        return _on_policy(settings, env, network)
    return _off_policy(settings, env, network)


def _on_policy(s: TrainSettings, env: TeamVecEnv, network: dict[str, Any]) -> BaseAlgorithm:
    """Return PPO or MAPPO."""
    network["optimizer_kwargs"]["eps"] = _ADAM_EPSILON
    rows = even_minibatch(s.rollout * env.num_envs, s.minibatch)
    kind: Any = partial(PPO, "MlpPolicy", rollout_buffer_class=FlatRolloutBuffer)
    if s.algorithm == "mappo":
        kind = partial(PPO, CentralizedCriticPolicy, rollout_buffer_class=FlatRolloutBuffer)
        network |= {"private_size": env.private_size, "hidden": s.hidden}
    else:
        network |= {"net_arch": list(s.hidden)}
    model: BaseAlgorithm = kind(
        env,
        learning_rate=_LearningRate(s),
        n_steps=s.rollout,
        batch_size=rows,
        n_epochs=s.epochs,
        gamma=s.discount,
        gae_lambda=s.gae_lambda,
        clip_range=s.clip,
        ent_coef=s.entropy,
        vf_coef=s.value_weight,
        policy_kwargs={**network, "log_std_init": s.log_deviation},
        stats_window_size=500,
        seed=s.seed,
        device="cpu",
    )
    if s.advise is not None:
        # The policy begins as its adviser, which small random corrections would already impair.
        policy: Any = model.policy
        nn.init.zeros_(policy.action_net.weight)
    return model


def _off_policy(s: TrainSettings, env: TeamVecEnv, network: dict[str, Any]) -> BaseAlgorithm:
    """Return SAC or TD3."""
    shape = env.action_shape
    exploring: dict[str, Any] = (
        {"ent_coef": _ENTROPY}
        if s.algorithm == "sac"
        else {"action_noise": NormalActionNoise(np.zeros(shape), np.full(shape, _EXPLORATION))}
    )
    return (SAC if s.algorithm == "sac" else TD3)(
        "MlpPolicy",
        env,
        learning_rate=_LearningRate(s),
        buffer_size=s.replay,
        learning_starts=s.learning_starts,
        batch_size=s.minibatch,
        gamma=s.discount,
        gradient_steps=s.gradients,
        **exploring,
        policy_kwargs={**network, "net_arch": list(s.hidden)},
        seed=s.seed,
        device="cpu",
    )


class _LearningRate:
    """A learning rate that falls linearly from the start to the end of training."""

    def __init__(self, settings: TrainSettings) -> None:
        self._first, self._last = settings.learning_rate, settings.final_learning_rate

    def __call__(self, remaining: float) -> float:
        # Rollouts are completed, so the last one may end after the requested steps.
        left = max(0.0, remaining)
        return self._last + left * (self._first - self._last)


def even_minibatch(rows: int, wanted: int) -> int:
    """Return the divisor of ``rows`` that is nearest to ``wanted`` in proportion."""
    sizes = [d for k in range(1, int(rows**0.5) + 1) if rows % k == 0 for d in (k, rows // k)]
    return min(sizes, key=lambda size: max(size / wanted, wanted / size))
