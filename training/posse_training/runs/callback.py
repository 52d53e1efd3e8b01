"""What a run does between rollouts: statistics, evaluations on validation worlds, checkpoints."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import ActorCriticPolicy

from posse_baselines.files import write_atomically
from posse_baselines.learned import LearnedPolicy
from posse_training.errors import CheckpointError, DivergedError
from posse_training.runs.display import Display
from posse_training.runs.models import make_adviser
from posse_training.runs.saved.checkpoint import Arrays, write_checkpoint
from posse_training.runs.saved.curve import Point, as_csv, best_of
from posse_training.runs.saved.export import export, make_card
from posse_training.runs.saved.folder import BEST, CURVE, LAST
from posse_training.runs.saved.model_state import model_state, random_state, restore_model, restore_random_state
from posse_training.runs.settings import TrainSettings
from posse_training.runs.validation import validate
from posse_training.sb3.contact_bound import ContactBound
from posse_training.sb3.normalisation import RunningStatistics
from posse_training.sb3.vec_env import TeamVecEnv

_STATISTICS_EVERY: Final = 8  # every eighth step of a rollout is added to the statistics


class TrainingCallback(BaseCallback):
    """Statistics, evaluations and checkpoints of a run.

    All of it happens between rollouts, where a run can be interrupted and resumed.

    Args:
        settings: Of the run.
        folder: Its folder.
        env: Its worlds.
        model: Its model.
        statistics: Input statistics, applied to the model between rollouts.
        display: Shows progress.

    Attributes:
        curve: One point for each evaluation.
        bound: The bound on contact, if there is one.
    """

    def __init__(
        self,
        settings: TrainSettings,
        folder: Path,
        env: TeamVecEnv,
        model: BaseAlgorithm,
        statistics: RunningStatistics,
        display: Display,
    ) -> None:
        super().__init__()
        self.settings = settings
        self.folder = folder
        self.env = env
        self.model = model
        self.statistics = statistics
        self.display = display
        self.curve: list[Point] = []
        share = settings.contact_bound
        self.bound = None if share is None else ContactBound(share)
        self._price()
        self._seconds_before = 0.0
        self._started = time.monotonic()
        # A copy or an adviser may already be better than what a short run makes of it.
        warm = settings.imitate is not None or settings.advise is not None
        self._next_evaluation = 0 if warm else settings.evaluate_every
        self._next_checkpoint = 0
        self._rollouts = 0
        self._saved_at: int | None = None  # steps at the last checkpoint

    def _price(self) -> None:
        """Have contacts cost what the bound's multiplier says."""
        if self.bound is not None:
            self.env.set_contact_cost(self.bound.multiplier)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        buffer = getattr(self.model, "rollout_buffer", None)
        if buffer is not None:
            self.statistics.add(buffer.observations[::_STATISTICS_EVERY])
        elif self._rollouts % _STATISTICS_EVERY == 0:
            self.statistics.add(np.asarray(self.model._last_obs))
        self._rollouts += 1
        terms = self.env.take_terms()
        steps = self.settings.rollout if self.settings.on_policy else 1
        for name, total in terms.items():
            self.model.logger.record_mean(f"reward/{name}", total / steps)
        first, episodes = self.env.take_contacts()
        if self.bound is not None:
            self.bound.update(first, episodes)
            self._price()
            self.model.logger.record("contact/share", self.bound.share)
            self.model.logger.record("contact/multiplier", self.bound.multiplier)

    def _on_rollout_start(self) -> None:
        self._limit_deviation()
        score = self._training_score()
        if score is not None:
            self.model.logger.record("training/score", score)
        if self.settings.on_policy or self._rollouts % 100 == 0:
            self.statistics.apply(self.model.policy)
        steps = self.model.num_timesteps
        if min(self._next_evaluation, self._next_checkpoint) <= steps:
            self._check_finite()
        if steps >= self._next_evaluation:
            self._next_evaluation = steps - steps % self.settings.evaluate_every
            self._next_evaluation += self.settings.evaluate_every
            self._evaluate()
        if steps >= self._next_checkpoint:
            self._next_checkpoint = steps + self.settings.checkpoint_every
            self._checkpoint()
        self._show_progress()

    def _limit_deviation(self) -> None:
        """Keep the actions' deviation within its limit, which falls with the steps made."""
        s, policy = self.settings, self.model.policy
        if s.final_log_deviation is None or not s.on_policy:
            return
        share = min(1.0, self.model.num_timesteps / s.steps)
        limit = s.log_deviation + share * (s.final_log_deviation - s.log_deviation)
        with torch.no_grad():
            cast("ActorCriticPolicy", policy).log_std.clamp_(max=limit)

    def _check_finite(self) -> None:
        """Raise before numbers that are not finite are evaluated or saved.

        Raises:
            DivergedError: The message names what is kept.
        """
        tensors = self.model.policy.state_dict().values()
        if not all(bool(torch.isfinite(tensor).all()) for tensor in tensors):
            raise DivergedError(self.divergence())

    def divergence(self) -> str:
        """Return what happened, what is kept, and what to do, where networks are not finite."""
        kept = "nothing was saved before"
        if self._saved_at is not None:
            kept = f"the checkpoint at {self._saved_at:,} steps is kept"
            if self.curve:
                best = max(self.curve, key=lambda point: point["safe_score"])
                kept += f", and {BEST} of {int(best['steps']):,} steps"
        return (
            f"the training diverged at {self.model.num_timesteps:,} steps: its networks give "
            f"numbers that are not finite; {kept}. Lower --learning-rate, or --log-deviation, and "
            "train again in another --folder"
        )

    def _show_progress(self) -> None:
        self.display.progress(self.model.num_timesteps, self._training_score(), self.bound)

    def _training_score(self) -> float | None:
        episodes = self.model.ep_info_buffer or ()
        return float(np.mean([e["score"] for e in episodes])) if episodes else None

    def _policy(self) -> LearnedPolicy:
        card = make_card(self.settings, self.env.encoding, steps=self.model.num_timesteps, curve=self.curve)
        adviser = make_adviser(self.settings)
        return export(self.model, self.env.encoding, card, adviser, self.settings.correction)

    def _seconds(self) -> float:
        return self._seconds_before + time.monotonic() - self._started

    def _evaluate(self) -> None:
        """Evaluate on the validation worlds; keep the policy if it is the best so far."""
        point = {
            "steps": float(self.model.num_timesteps),
            "seconds": self._seconds(),
            **validate(self.settings, self._policy()),
        }
        best = best_of(self.curve)
        self.curve.append(point)
        self._write(BEST if best is None or point["safe_score"] > best else None)
        for name in ("safe_score", "score", "contact_free"):
            self.model.logger.record(f"validation/{name}", point[name])
        # Now, so that they are logged at the step that they belong to.
        self.model.logger.dump(self.model.num_timesteps)
        self._show_progress()
        self.display.evaluated(point)

    def _write(self, name: str | None) -> None:
        """Write the curve, and the policy under a name if there is one."""
        try:
            write_atomically(self.folder / CURVE, as_csv(self.curve))
            if name is not None:
                self._policy().save(self.folder / name)
        except OSError as error:
            raise CheckpointError(
                f"cannot write to {self.folder}: {error.strerror or error}. Make room, then resume "
                f"with: posse train --resume {self.folder}"
            ) from error

    def _checkpoint(self) -> None:
        arrays: Arrays = {}
        state: dict[str, Any] = {
            "curve": self.curve,
            "seconds": self._seconds(),
            "next_evaluation": self._next_evaluation,
            "next_checkpoint": self._next_checkpoint,
            "rollouts": self._rollouts,
            "contact_bound": None if self.bound is None else self.bound.save(),
        }
        for name, (part, values) in {
            "model": model_state(self.model),
            "random": random_state(),
            "worlds": (self.env.save(), {}),
            "statistics": (self.statistics.save(), {}),
        }.items():
            state[name] = values
            arrays |= {f"{name}/{key}": array for key, array in part.items()}
        write_checkpoint(self.folder, arrays, state)
        self._saved_at = self.model.num_timesteps

    def restore(self, arrays: Arrays, state: dict[str, Any]) -> None:
        """Go back to where a checkpoint was written.

        Raises:
            CheckpointError: The checkpoint does not fit the settings.
        """

        def part(name: str) -> Arrays:
            start = f"{name}/"
            return {k.removeprefix(start): a for k, a in arrays.items() if k.startswith(start)}

        try:
            self.env.restore(part("worlds"))
            self.statistics.restore(part("statistics"))
            restore_model(self.model, part("model"), state["model"])
            restore_random_state(part("random"), state["random"])
            self.curve = list(state["curve"])
            self._seconds_before = float(state["seconds"])
            self._next_evaluation = int(state["next_evaluation"])
            self._next_checkpoint = int(state["next_checkpoint"])
            self._rollouts = int(state["rollouts"])
            self._saved_at = self.model.num_timesteps
            if self.bound is not None:
                self.bound.restore(state["contact_bound"])
                self._price()
        except Exception as error:  # whatever a state of other settings raises
            raise CheckpointError(
                f"the checkpoint in {self.folder} does not fit its settings: {error!s:.300}. "
                "Restore settings.json, or start the training again in another --folder"
            ) from error

    def finish(self) -> None:
        """Evaluate once more, and write the last policy and checkpoint."""
        self.statistics.apply(self.model.policy)
        self._check_finite()
        if not self.curve or self.curve[-1]["steps"] < self.model.num_timesteps:
            self._evaluate()
        self._write(LAST)
        self._checkpoint()
