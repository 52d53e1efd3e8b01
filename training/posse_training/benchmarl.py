"""With BenchMARL: scenarios as its tasks, a batch of worlds with the state, either kind of action.

Policies of BenchMARL learn from ``("agents", "observation")``, critics and mixers from ``"state"``. BenchMARL wants a
torchrl before 0.12.
"""

from collections.abc import Callable
from typing import Any

from posse_training.errors import MissingExtraError

try:
    from benchmarl.environments import Task, TaskClass, task_config_registry
except ImportError as error:
    raise MissingExtraError(
        f"benchmarl cannot be imported ({error}). It wants a virtual environment of its own: "
        "`make recipes`, from a clone, makes one"
    ) from error

from torchrl.data import Composite
from torchrl.envs import EnvBase

from posse_training.torchrl import PosseEnv

__all__ = ["PosseTask", "PosseTaskClass", "register"]


class PosseTaskClass(TaskClass):
    """One scenario. ``config`` holds ``scenario`` and any setting of it."""

    def get_env_fun(
        self, num_envs: int, continuous_actions: bool, seed: int | None, device: Any
    ) -> Callable[[], EnvBase]:
        """Return a function that makes ``num_envs`` worlds."""
        settings = {**self.config, "seed": 0 if seed is None else seed}
        return lambda: PosseEnv(
            num_worlds=num_envs, device=device, state=True, discrete_actions=not continuous_actions, **settings
        )

    def supports_continuous_actions(self) -> bool:
        """Return ``True``."""
        return True

    def supports_discrete_actions(self) -> bool:
        """Return ``True``."""
        return True

    def max_steps(self, env: EnvBase) -> int:
        """Return the length of an episode."""
        return int(env.batch.scenario.horizon)

    def has_render(self, env: EnvBase) -> bool:
        """Return ``False``: ``posse watch`` and ``posse replay`` show what was learned."""
        return False

    def group_map(self, env: EnvBase) -> dict[str, list[str]]:
        """Return the agents' names by group."""
        return dict(env.group_map)

    def observation_spec(self, env: EnvBase) -> Composite:
        """Return the spec of what the trackers observe."""
        spec = env.full_observation_spec_unbatched.clone()
        for name in ("state", "score"):
            del spec[name]
        return spec

    def state_spec(self, env: EnvBase) -> Composite:
        """Return the spec of the state."""
        return Composite({"state": env.full_observation_spec_unbatched["state"].clone()})

    def action_spec(self, env: EnvBase) -> Composite:
        """Return the spec of the actions."""
        return env.full_action_spec_unbatched

    def action_mask_spec(self, env: EnvBase) -> None:
        """Return ``None``: every action is always allowed."""

    def info_spec(self, env: EnvBase) -> None:
        """Return ``None``."""

    @staticmethod
    def log_info(batch: Any) -> dict[str, float]:
        """Return what is logged beside the rewards: the mean score of the collected steps."""
        return {"score": batch["next", "score"].mean().item()}

    @staticmethod
    def env_name() -> str:
        """Return the name of the environment in task names, ``posse/smart``."""
        return "posse"


class PosseTask(Task):
    """A task for each scenario that all of BenchMARL's algorithms may learn."""

    CONSTANT = None
    SMART = None
    SEARCH = None
    OBSTACLES = None
    RADIO = None
    FIELD = None

    @staticmethod
    def associated_class() -> type[PosseTaskClass]:
        """Return :class:`PosseTaskClass`."""
        return PosseTaskClass

    def get_from_yaml(self, path: str | None = None) -> PosseTaskClass:
        """Return the task of a configuration file; default: the scenario as it is, on the split ``"train"``."""
        own = {"scenario": self.name.lower(), "split": "train"}
        task: PosseTaskClass = self.get_task(own) if path is None else super().get_from_yaml(path)
        return task


def register() -> None:
    """Make the tasks known to BenchMARL by name, ``posse/smart``."""
    task_config_registry.update({f"posse/{t.name.lower()}": t for t in PosseTask.__members__.values()})
