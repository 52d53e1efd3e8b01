"""With TorchRL: a batch of worlds as one environment. Needs the extra ``training``.

TorchRL steps batches and resets parts of them, as the engine does, so the adapter only renames.
E = worlds, N = trackers, F = observation length, m = message size::

    TensorDict (E,)
        ("agents", "observation")       (E, N, F) float32
        ("agents", "action")            (E, N, 2 + m) float32 in [-1, 1]; or (E, N) int64, 0 to 14
        ("agents", "reward")            (E, N, 1) float32
        "score"                         (E, 1) float32, of the latest step; 0 at the start
        "state"                         (E, S) float32, if asked for
        "done", "terminated", "truncated"   (E, 1) bool

If the target is an agent, it has its own group ``"target"``, with N = 1.
"""

from typing import Any, Final

from posse_training.errors import require

require("training", "torch", "tensordict", "torchrl")

import numpy as np  # noqa: E402
import torch  # noqa: E402
from tensordict import TensorDict, TensorDictBase  # noqa: E402
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded  # noqa: E402
from torchrl.envs import EnvBase  # noqa: E402

import posse  # noqa: E402
from posse.adapters.actions import MOTIONS, agent_names, as_motions, single_action_space  # noqa: E402
from posse.signals.layout import StateLayout  # noqa: E402
from posse_baselines import PolicyError  # noqa: E402
from posse_baselines.safeguard import Guard, check_room  # noqa: E402

__all__ = ["PosseEnv"]

TRACKERS: Final = "agents"
"""Group of the trackers, named as in TorchRL's multi-agent examples."""
TARGET: Final = "target"
"""Group of a target that is an agent."""


class PosseEnv(EnvBase):
    """A batch of E worlds of one scenario, ``batch_size=[E]``.

    TorchRL's rollouts and collectors reset the worlds whose episodes end. The worlds are on the CPU, where the
    tensors share the memory of the engine's arrays, which are not overwritten while a tensor refers to them; tensors
    on another device are copies.

    Args:
        scenario: A scenario, or the name of one.
        num_worlds: E, at least 1.
        device: Device of the tensors; any but the CPU costs a copy each way at each step.
        state: Whether the full state of each world comes with the observations, under ``"state"``,
            for centralized critics.
        discrete_actions: Whether actions are numbers of :data:`posse.adapters.actions.MOTIONS`, as elsewhere.
        safeguard: Whether the trackers' actions are wanted velocities, which the safeguard carries out
            (:mod:`posse_baselines.safeguard`).
        settings: As for :func:`posse.batch`: ``seed``, ``split``, ``first_world``, ``num_threads``,
            ``target_policy``, and any setting of the scenario, but not ``autoreset`` and ``team_policy``.

    Attributes:
        batch: The engine, with the layout, the state and the metrics.
        group_map: The agents' names by group.

    Raises:
        TypeError: ``autoreset`` or ``team_policy`` among the settings.
        PolicyError: ``safeguard`` with discrete actions, which are no velocities, or without room for its messages.
        ScenarioError: ``discrete_actions`` with messages, which are not discrete.
        ValueError: As :func:`posse.batch`.
    """

    def __init__(
        self,
        scenario: str | posse.Scenario = "constant",
        num_worlds: int = 1,
        *,
        device: torch.device | str = "cpu",
        state: bool = False,
        discrete_actions: bool = False,
        safeguard: bool = False,
        **settings: Any,
    ) -> None:
        if "autoreset" in settings:
            raise TypeError(f"autoreset={settings['autoreset']!r} cannot be set: TorchRL itself resets; leave it out")
        if "team_policy" in settings:
            raise TypeError("team_policy= is not possible: a PosseEnv has trackers; make its target an agent")
        self.batch = posse.batch(scenario, num_worlds, autoreset="disabled", **settings)
        single_action_space(self.batch.scenario.message_size, discrete_actions)  # raises if impossible
        super().__init__(device=device, batch_size=(num_worlds,))
        self._state_layout = StateLayout(self.batch.scenario) if state else None
        self._discrete = discrete_actions
        if safeguard and discrete_actions:
            raise PolicyError("discrete actions are no velocities: set safeguard or discrete_actions to False")
        if safeguard:
            check_room(self.batch.scenario)
        self._guard = Guard(self.batch.layout, num_worlds) if safeguard else None
        trackers = self.batch.scenario.num_trackers
        names = agent_names(self.batch)
        self._rows = {TRACKERS: slice(0, trackers)}
        if len(names) > trackers:
            self._rows[TARGET] = slice(trackers, None)
        self.group_map = {group: names[rows] for group, rows in self._rows.items()}
        self._seed: int | None = None
        self._make_specs()

    def _make_specs(self) -> None:
        worlds, rows, width = self.batch.action_shape
        low, high = (torch.from_numpy(bound).expand(worlds, rows, -1) for bound in self.batch.layout.bounds())
        observation, action, reward = (Composite(shape=(worlds,)) for _ in range(3))
        for group, part in self._rows.items():
            count = len(self.group_map[group])
            observation[group] = Composite(
                observation=Bounded(low[:, part], high[:, part], dtype=torch.float32), shape=(worlds, count)
            )
            each: Bounded | Categorical = (
                Bounded(-1.0, 1.0, (worlds, count, width), dtype=torch.float32)
                if not self._discrete
                else Categorical(len(MOTIONS), (worlds, count), dtype=torch.int64)
            )
            action[group] = Composite(action=each, shape=(worlds, count))
            reward[group] = Composite(reward=Unbounded((worlds, count, 1), dtype=torch.float32), shape=(worlds, count))
        observation["score"] = Bounded(0.0, 1.0, (worlds, 1), dtype=torch.float32)
        if self._state_layout is not None:
            observation["state"] = Unbounded((worlds, self._state_layout.size), dtype=torch.float32)
        flag = Binary(1, (worlds, 1), dtype=torch.bool)
        self.observation_spec = observation.to(self.device)
        self.action_spec = action.to(self.device)
        self.reward_spec = reward.to(self.device)
        self.done_spec = Composite(terminated=flag, truncated=flag.clone(), shape=(worlds,)).to(self.device)

    def _set_seed(self, seed: int | None) -> None:
        """Make the next reset of all worlds restart from episode 0 of a seed."""
        self._seed = seed

    def _reset(self, tensordict: TensorDictBase | None = None, **kwargs: Any) -> TensorDictBase:
        """Start an episode in every world, or in those that ``"_reset"`` (E, 1) marks.

        ``seed`` and ``options`` (start poses) of :meth:`reset` are those of :meth:`posse.Batch.reset`.
        """
        seed, options = kwargs.get("seed", self._seed), kwargs.get("options")
        mask = np.ones(self.batch.num_worlds, np.bool_)
        marks = None if tensordict is None else tensordict.get("_reset", None)
        if marks is not None:
            mask = marks.reshape(self.batch.num_worlds).cpu().numpy()
        whole = bool(mask.all())
        if not whole:
            seed, options = kwargs.get("seed"), {**(options or {}), "reset_mask": mask}
        observations = self.batch.reset(seed=seed, options=options)
        if whole:
            self._seed = None
        if self._guard is not None:
            self._guard.restart(mask)
        self._seen = observations[:, self._rows[TRACKERS]].copy()
        return self._pack(observations)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        if tensordict.get("_step", None) is not None:
            raise NotImplementedError(
                "the worlds of a PosseEnv are always stepped together: use rollout(..., break_when_any_done=False), "
                "which resets worlds that are done, instead of break_when_all_done=True"
            )
        by_group = [tensordict.get((group, "action")) for group in self._rows]
        together = by_group[0] if len(by_group) == 1 else torch.cat(by_group, dim=1)
        given, shape = together.detach().cpu().numpy(), self.batch.action_shape
        actions = as_motions("the array of actions", given, shape[:2] if self._discrete else shape, self._discrete)
        if self._guard is not None:
            self.batch.check_running()
            actions = self.batch.actions_of(actions)  # before the safeguard remembers this step
            motions = self._guard.actions(self._seen, actions[:, self._rows[TRACKERS]])
            actions = np.concatenate([motions, actions[:, motions.shape[1] :]], axis=1)
        observations, rewards, *_ = self.batch.step(actions)
        self._seen = observations[:, self._rows[TRACKERS]].copy()  # as _pack shares its memory
        packed = self._pack(observations)
        each = self._tensor(rewards).unsqueeze(-1)
        for group, part in self._rows.items():
            packed.set((group, "reward"), each[:, part])
        return packed

    def _pack(self, observations: Any) -> TensorDict:
        """Return all but the rewards under TorchRL's names."""
        each = self._tensor(observations)
        packed = TensorDict({}, batch_size=self.batch_size, device=self.device)
        for group, part in self._rows.items():
            size = (*self.batch_size, len(self.group_map[group]))
            packed.set(group, TensorDict({"observation": each[:, part]}, batch_size=size))
        worlds = self.batch.arrays.world
        ended, terminated = worlds["over"] != 0, worlds["terminated"] != 0
        ends = {"done": ended, "terminated": terminated, "truncated": ended & ~terminated}
        for name, values in {"score": worlds["score"].copy(), **ends}.items():
            packed.set(name, self._tensor(values).unsqueeze(-1))
        if self._state_layout is not None:
            packed.set("state", self._tensor(self._state_layout.vector(self.batch.arrays)))
        return packed

    def _tensor(self, array: Any) -> torch.Tensor:
        """Return an array of the engine as a tensor on the device."""
        return torch.from_numpy(array).to(self.device)
