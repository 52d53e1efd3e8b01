"""With stable-baselines3: worlds as its vector environment, and its models as posse policies.

Needs the extra ``training``.
"""

from typing import Any

from posse_training.errors import require

require("training", "torch", "stable_baselines3")

import numpy as np  # noqa: E402
from gymnasium import spaces  # noqa: E402
from stable_baselines3.common.base_class import BaseAlgorithm  # noqa: E402
from stable_baselines3.common.vec_env import VecNormalize  # noqa: E402

from posse import ObservationLayout  # noqa: E402
from posse.adapters.actions import MOTIONS  # noqa: E402
from posse.numeric import BoolArray, FloatArray  # noqa: E402
from posse.scenarios.setting import check_count  # noqa: E402
from posse_baselines import PolicyError  # noqa: E402
from posse_baselines.learned import Encoder, Encoding  # noqa: E402
from posse_baselines.policy import BasePolicy, check_observations  # noqa: E402
from posse_baselines.safeguard import Guard, check_room  # noqa: E402
from posse_training.train.vec_env import TeamVecEnv  # noqa: E402

__all__ = ["TeamVecEnv", "from_sb3"]


class from_sb3(BasePolicy):  # noqa: N801 (used as a function is)
    """A policy that plays what a stable-baselines3 model has learned.

    A model of one observation (F,), as in ``posse/Solo-v0``, ``posse/Tracker-v0`` and
    :class:`posse_training.sb3.TeamVecEnv`, plays every tracker of the team; one of (N, F), as in
    ``posse/Team-v0``, the whole team. Discrete actions are understood too, and so are recurrent
    policies: their states restart with the episode. Actions are the mode of the model's distribution. A model of a
    target is refused where it would play: ``posse train --side target`` makes targets.

    Args:
        model: A model; one from a file is ``PPO.load(path)``, by the class of its algorithm.
        name: Its name in results; default: the algorithm's.
        message_size: Numbers of a message in the observations that it learned on, 0 in
            ``posse/Solo-v0`` and ``posse/Team-v0`` by default, what the team-mates need in
            ``posse/Tracker-v0``; where poses drift, with the five of the safeguard. A model whose action lacks the
            message says zeros.
        encoding: How observations were encoded for it, where it learned in ``TeamVecEnv``.
        normalize: The wrapper whose statistics it learned with; default: the model's own, which one from a file lacks.
        safeguard: Whether it learned behind the safeguard, as in ``TeamVecEnv(..., safeguard=True)``.

    Attributes:
        whole_team: Whether one observation is that of all trackers, so that no robot can play it alone.

    Raises:
        PolicyError: Spaces that no environment of posse has; no model; a ``normalize`` that is no VecNormalize.
    """

    def __init__(
        self,
        model: BaseAlgorithm,
        *,
        name: str | None = None,
        message_size: int = 0,
        encoding: Encoding | None = None,
        normalize: VecNormalize | None = None,
        safeguard: bool = False,
    ) -> None:
        if not isinstance(model, BaseAlgorithm):
            raise PolicyError(f"{model!r:.80} is no model: load the file by its class, PPO.load(path)")
        self.model, self.message_size = model, check_count("message_size", message_size, 0)
        self.name = name or type(model).__name__
        if not isinstance(normalize, (VecNormalize, type(None))):
            raise PolicyError(f"normalize={normalize!r:.80} is no VecNormalize: load it, VecNormalize.load(path, envs)")
        self._encoding, self._safeguard = encoding, safeguard
        self._normalize = normalize or model.get_vec_normalize_env()
        shape = model.observation_space.shape
        if shape is None or len(shape) not in (1, 2) or (encoding is not None and len(shape) == 2):
            raise PolicyError(f"a model of observations {model.observation_space} plays no team: wanted (F,) or (N, F)")
        actions, rows = model.action_space, shape[:-1]
        self._discrete = isinstance(actions, (spaces.Discrete, spaces.MultiDiscrete))
        choices = np.asarray(getattr(actions, "nvec", getattr(actions, "n", 0)))
        fits = choices.shape == rows and (choices == len(MOTIONS)).all()
        if isinstance(actions, spaces.Box):
            bounds = np.all((actions.low == -1) & (actions.high == 1))
            fits = actions.shape[:-1] == rows and actions.shape[-1] >= 2 and bounds
        if not fits:
            raise PolicyError(f"a model with actions {actions} plays no team: it must have learned on those of posse")
        self.whole_team = len(shape) == 2

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Any:
        """Return the memory: the layout, how observations are encoded, the safeguard, and a network's states."""
        super().begin(layout, num_worlds)
        encoder = None if self._encoding is None else Encoder(self._encoding, layout, num_worlds)
        size = layout.size if self._encoding is None else self._encoding.size
        wanted = self.model.observation_space.shape
        got = (layout.scenario.num_trackers, size) if self.whole_team else (size,)
        if wanted != got:
            raise PolicyError(
                f"policy {self.name!r} learned on observations {wanted}, and those of {layout.scenario.name!r} "
                f"with message_size={layout.scenario.message_size} are {got}: give from_sb3 the message_size that it "
                "learned with, the scenario its settings, and the model no wrapper that changes observations"
            )
        rows = num_worlds * (1 if self.whole_team else layout.scenario.num_trackers)
        if self._safeguard:
            check_room(layout.scenario)
        guard = Guard(layout, num_worlds) if self._safeguard else None
        return layout, num_worlds, encoder, guard, None, np.ones(rows, np.bool_)

    def restart(self, memory: Any, mask: BoolArray) -> Any:
        """Return the memory with recurrent networks restarted in the worlds of a mask (E,)."""
        layout, worlds, encoder, guard, states, begins = memory
        if encoder is not None:
            encoder.restart(mask)
        if guard is not None:
            guard.restart(mask)
        return (layout, worlds, encoder, guard, states, begins | np.repeat(mask, len(begins) // len(mask)))

    def act(self, observations: FloatArray, memory: Any) -> tuple[FloatArray, Any]:
        """Return actions (E, N, 2 + m) for observations (E, N, F)."""
        layout, worlds, encoder, guard, states, begins = memory
        seen = check_observations(observations, (worlds, layout.scenario.num_trackers), layout)
        trackers = seen.shape[1]
        if encoder is not None:
            seen = encoder.encode(seen, guard)
        rows = seen if self.whole_team else seen.reshape(worlds * trackers, -1)
        if self._normalize is not None:
            rows = np.asarray(self._normalize.normalize_obs(rows))
        chosen, states = self.model.predict(rows, state=states, episode_start=begins, deterministic=True)
        motions = MOTIONS[chosen] if self._discrete else np.clip(chosen, -1, 1)
        motions = motions.reshape(worlds, trackers, -1)
        actions = np.zeros((worlds, trackers, 2 + layout.scenario.message_size), np.float32)
        actions[..., : motions.shape[-1]] = motions
        if guard is not None:
            actions = guard.actions(observations, actions)
        return actions, (layout, worlds, encoder, guard, states, np.zeros_like(begins))
