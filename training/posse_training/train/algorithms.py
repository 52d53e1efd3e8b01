"""The algorithms: one entry of a table and one function for each.

Importing this module does not import torch, so that ``posse train --help`` is fast.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from posse import Family
from posse_training.errors import SettingsError
from posse_training.train.settings import TrainSettings

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

    from posse_training.train.vec_env import TeamVecEnv

_ADAM_EPSILON: Final = 1e-5  # the default of stable-baselines3's PPO
_EXPLORATION: Final = 0.1  # standard deviation of the noise on td3's actions
_ENTROPY: Final = "auto_0.01"  # of sac: from 1, rewards of 0.1 a step count for nothing at first


@dataclass(frozen=True)
class Algorithm:
    """What a run needs to know of an algorithm.

    Attributes:
        make: Returns an untrained model of stable-baselines3.
        actor: Modules of the model's policy with its layers from normalised input to action, for the exported policy.
        bound: How the exported policy bounds the last layer's output: ``"clip"`` or ``"tanh"``.
        on_policy: Whether it learns from its latest rollout only.
        reads_state: Whether its observations end with the state of the world, for its value function.
    """

    make: Callable[[TrainSettings, TeamVecEnv], BaseAlgorithm]
    actor: tuple[str, ...]
    bound: str
    on_policy: bool = False
    reads_state: bool = False


def _mappo(s: TrainSettings, env: TeamVecEnv) -> BaseAlgorithm:
    from posse_training.train.networks import CentralizedCriticPolicy

    return _ppo(s, env, CentralizedCriticPolicy, private_size=env.encoding.size)


def _ppo(s: TrainSettings, env: TeamVecEnv, policy: Any = "MlpPolicy", **network: Any) -> BaseAlgorithm:
    from stable_baselines3 import PPO

    return PPO(
        policy,
        env,
        n_steps=s.rollout,
        batch_size=even_minibatch(s.rollout * env.num_envs, s.minibatch),
        n_epochs=s.epochs,
        gae_lambda=s.gae_lambda,
        clip_range=s.clip,
        ent_coef=s.entropy,
        vf_coef=s.value_weight,
        stats_window_size=500,
        policy_kwargs=_network(s, log_std_init=s.log_deviation, **network),
        **_common(s),
    )


def _sac(s: TrainSettings, env: TeamVecEnv) -> BaseAlgorithm:
    from stable_baselines3 import SAC

    return SAC("MlpPolicy", env, ent_coef=_ENTROPY, **_off_policy(s))


def _td3(s: TrainSettings, env: TeamVecEnv) -> BaseAlgorithm:
    from stable_baselines3 import TD3
    from stable_baselines3.common.noise import NormalActionNoise

    noise = NormalActionNoise(np.zeros(env.action_length), np.full(env.action_length, _EXPLORATION))
    return TD3("MlpPolicy", env, action_noise=noise, **_off_policy(s))


def _off_policy(s: TrainSettings) -> dict[str, Any]:
    return {
        "buffer_size": s.replay,
        "learning_starts": s.learning_starts,
        "batch_size": s.minibatch,
        "gradient_steps": s.gradients,
        "policy_kwargs": _network(s),
        **_common(s),
    }


def _common(s: TrainSettings) -> dict[str, Any]:
    from stable_baselines3.common.utils import LinearSchedule

    rate = LinearSchedule(s.learning_rate, s.final_learning_rate, 1.0)
    return {"learning_rate": rate, "gamma": s.discount, "seed": s.seed, "device": "cpu"}


def _network(s: TrainSettings, **further: Any) -> dict[str, Any]:
    """Return the arguments of a policy's networks."""
    from posse_training.train.networks import ACTIVATIONS, Normaliser

    adam = {"fused": True, "eps": _ADAM_EPSILON} if ALGORITHMS[s.algorithm].on_policy else {"fused": True}
    return {
        "net_arch": list(s.hidden),
        "activation_fn": ACTIVATIONS[s.activation],
        "features_extractor_class": Normaliser,
        "optimizer_kwargs": adam,
        **further,
    }


_PPO_ACTOR: Final = ("mlp_extractor.policy_net", "action_net")
ALGORITHMS: Final = {
    "ppo": Algorithm(_ppo, _PPO_ACTOR, "clip", on_policy=True),
    "mappo": Algorithm(_mappo, _PPO_ACTOR, "clip", on_policy=True, reads_state=True),
    "sac": Algorithm(_sac, ("actor.latent_pi", "actor.mu"), "tanh"),
    "td3": Algorithm(_td3, ("actor.mu",), "tanh"),
}
"""By name; a new algorithm is an entry here, and the function that makes it."""
EVOLUTION: Final = "cmaes"
"""The algorithm that has no model of stable-baselines3 (:mod:`posse_training.evolution`)."""


_GRADIENT: Final = "ppo, mappo, sac and td3"
_READ_BY: Final = {
    "ppo and mappo": "rollout epochs gae_lambda clip entropy value_weight log_deviation final_log_deviation",
    "sac and td3": "replay learning_starts gradients",
    "cmaes": "population deviation",
    _GRADIENT: "reward_weights end_on_contact num_neighbours hidden activation learning_rate "
    "final_learning_rate discount minibatch checkpoint_every threads family_scenarios",
}
"""Settings that only some algorithms read."""


def algorithm_of(name: str) -> Algorithm:
    """Return an algorithm by name, or raise SettingsError."""
    if name not in ALGORITHMS:
        raise SettingsError(f"unknown algorithm {name!r:.80}; algorithms are: {', '.join([*ALGORITHMS, EVOLUTION])}")
    return ALGORITHMS[name]


def check_algorithm(settings: TrainSettings) -> None:
    """Raise SettingsError if the algorithm is unknown, or cannot learn with these settings."""
    name = settings.algorithm
    kind = None if name == EVOLUTION else algorithm_of(name)
    if settings.side == "target" and (kind is None or kind.reads_state):
        raise SettingsError(
            f"algorithm={name!r} does not go with side='target', which observes all, has no slots and corrects no "
            "script: use ppo"
        )
    if kind is None:
        if settings.encoding == "plain":
            raise SettingsError(f"encoding='plain' leaves {name} nothing to read: use features")
        if settings.advise is not None and settings.safeguard:
            raise SettingsError(
                f"safeguard=True does not go with advise={settings.advise!r}, which has a safeguard of its own: use "
                "--no-safeguard, as the preset residual does"
            )
        for other in ("start", "imitate", "message_size", "wandb"):
            if value := getattr(settings, other):
                raise SettingsError(
                    f"{other}={value!r} does not go with {name}, whose team begins with weights of zero and adds no "
                    "messages: leave it out, or set algorithm to ppo"
                )
    elif settings.advise is not None:
        raise SettingsError(f"advise={settings.advise!r} needs algorithm {EVOLUTION}, not {name}: leave one out")
    elif settings.imitate is not None and not kind.on_policy:
        raise SettingsError(f"imitate={settings.imitate!r} needs algorithm ppo or mappo, not {name}: leave it out")


def check_read(settings: TrainSettings, default: TrainSettings) -> None:
    """Raise SettingsError for a setting that differs from its default, though the algorithm does not read it."""
    name, kind = settings.algorithm, ALGORITHMS.get(settings.algorithm)
    own = [name] if kind is None else [_GRADIENT, "ppo and mappo" if kind.on_policy else "sac and td3"]
    for group in [group for group in _READ_BY if group not in own]:
        for each in _READ_BY[group].split():
            if (value := getattr(settings, each)) != getattr(default, each):
                raise SettingsError(f"{each}={value!r} is for {group}, not {name}: leave it out, or change algorithm")
    families = any(isinstance(given, Family) for given in settings.given)
    for each, read, what in (
        ("imitate_rounds", settings.imitate is not None, "--imitate"),
        ("family_scenarios", families, "families of scenarios"),
    ):
        if not read and (value := getattr(settings, each)) != getattr(default, each):
            raise SettingsError(f"{each}={value!r} is for {what}: leave it out")


def even_minibatch(rows: int, wanted: int) -> int:
    """Return the divisor of ``rows`` that is nearest to ``wanted`` in proportion; SettingsError below two rows."""
    if rows < 2:
        raise SettingsError(f"a rollout of {rows} row is too short to learn from: raise rollout or num_worlds")
    sizes = [d for k in range(1, int(rows**0.5) + 1) if rows % k == 0 for d in (k, rows // k) if d > 1]
    return min(sizes, key=lambda size: max(size / wanted, wanted / size))
