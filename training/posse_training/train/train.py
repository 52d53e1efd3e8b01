"""``posse train``: from settings to a trained policy, in the order it runs."""

import contextlib
import importlib.util
import time
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from rich.console import Console
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from posse_baselines import load
from posse_baselines.files import write_json
from posse_training.errors import RunFolderError, SettingsError
from posse_training.evolution import check_adviser, evolve
from posse_training.files import check_held, locked, write_csv
from posse_training.train import checkpoint
from posse_training.train.algorithms import ALGORITHMS, EVOLUTION, check_algorithm
from posse_training.train.checkpoint import Progress, State, arrays_of, tensors_of
from posse_training.train.display import Display, make_logger
from posse_training.train.export import export, make_card
from posse_training.train.imitation import imitate
from posse_training.train.networks import RunningStatistics
from posse_training.train.settings import BEST, CURVE, FREE, LAST, SETTINGS, TrainSettings, read_settings
from posse_training.train.validation import LOAD, first_statistics, score_beside, validate
from posse_training.train.vec_env import TeamVecEnv
from posse_training.train.worlds import divided, make_env

_STATISTICS_EVERY: Final = 8  # every eighth step of a rollout is added to the statistics
_APPLY_EVERY: Final = 100  # rollouts off policy, which are one step each


def train(settings: TrainSettings, *, console: Console | None = None, num_threads: int | None = None) -> Path:
    """Train a policy; return the file of the one that scored best on the validation worlds.

    A run folder that holds a run of the same settings is resumed, perhaps for more steps than before.

    Args:
        settings: All that the result depends on.
        console: Where to show progress.
        num_threads: Threads that step the worlds; default: one per core. Never changes the result.

    Raises:
        SettingsError, PolicyError: What :func:`check_before` finds.
        RunFolderError: The folder is in use, has other settings or a damaged checkpoint; or the networks diverged.
    """
    check_before(settings)
    folder = settings.run_folder
    with contextlib.ExitStack() as stack:
        stack.callback(torch.set_num_threads, torch.get_num_threads())
        torch.set_num_threads(settings.threads)
        if settings.algorithm != EVOLUTION:  # both refuse what does not fit, before the folder is made
            env = make_env(settings, num_threads)
            model = ALGORITHMS[settings.algorithm].make(settings, env)
            env.arrays()  # an opponent's memory that cannot be saved raises now, not at the first checkpoint
        stack.enter_context(locked(folder))
        check_held(folder / SETTINGS, settings.held(), FREE, (BEST, LAST, checkpoint.CHECKPOINT))
        # A run killed before its first checkpoint starts again, with the same result.
        saved = checkpoint.read_checkpoint(folder) if (folder / checkpoint.CHECKPOINT).exists() else None
        display = Display(settings, console or Console())
        stack.enter_context(display.bar)
        display.beside = score_beside(settings, display)
        if settings.algorithm == EVOLUTION:
            write_json(folder / SETTINGS, settings.held())
            return evolve(settings, folder, display, num_threads)
        model.set_logger(make_logger(folder, settings))
        run = Run(settings, folder, env, model, display)
        if saved is None:
            run.begin()
        else:
            run.restore(saved)
            display.note(f"resuming {folder} at {model.num_timesteps:,} steps")
        write_json(folder / SETTINGS, settings.held())  # now that it can begin
        display.begin(model.num_timesteps, max(model.num_timesteps, steps_made(settings, env.num_envs)))
        try:
            # In turn: run._on_rollout_start, a rollout, run._on_rollout_end, updates of the networks.
            model.learn(settings.steps - model.num_timesteps, callback=run, reset_num_timesteps=saved is None)
            run.finish()
        except ValueError as error:  # torch's distributions refuse numbers that are not finite
            run.check_finite(error)
            raise
    return folder / BEST


def steps_made(settings: TrainSettings, num_envs: int) -> int:
    """Return the steps that a run makes: whole rollouts, or whole steps of all worlds."""
    at_once = num_envs * (settings.rollout if ALGORITHMS[settings.algorithm].on_policy else 1)
    return -(-settings.steps // at_once) * at_once


def check_before(settings: TrainSettings) -> None:
    """Raise what can be known to be wrong before the run folder is made."""
    if settings.wandb is not None and importlib.util.find_spec("wandb") is None:
        raise SettingsError(f"wandb={settings.wandb!r} needs Weights & Biases: pip install wandb, or leave it out")
    check_algorithm(settings)
    if settings.algorithm == EVOLUTION:
        check_adviser(settings)
    divided(settings)
    goes_on = (settings.run_folder / checkpoint.CHECKPOINT).exists()
    if settings.beside is not None:
        LOAD[settings.side](settings.beside)
    if goes_on:
        return  # what follows is about the beginning of a run
    if settings.imitate is not None and not hasattr(load(settings.imitate), "propose") and settings.safeguard:
        teachers = "imitate belief-planner or a team of the DDCS, or use --no-safeguard"
        raise SettingsError(f"imitate={settings.imitate!r} proposes no velocities to the safeguard: {teachers}")
    kind, first = ALGORITHMS.get(settings.algorithm), settings.learning_starts
    if kind is not None and not kind.on_policy and first >= settings.steps:
        raise SettingsError(f"learning_starts={first} must be below steps={settings.steps}: lower it")
    if settings.start is not None:
        checkpoint.read_checkpoint(start := Path(settings.start))
        theirs = read_settings(start / SETTINGS)
        for name in ("side", "activation", "encoding", "safeguard"):
            if (value := getattr(theirs, name)) != (own := getattr(settings, name)):
                raise SettingsError(f"start={settings.start!r} has {name}={value!r}, not {own!r}: set that likewise")


class Run(BaseCallback):
    """A run and what it does, in order: begin or restore; before and after each rollout; finish.

    Attributes:
        at: How far it is.
    """

    def __init__(
        self, settings: TrainSettings, folder: Path, env: TeamVecEnv, model: BaseAlgorithm, display: Display
    ) -> None:
        super().__init__()
        self.settings, self.folder, self.env, self.model, self.display = settings, folder, env, model, display
        self.on_policy = ALGORITHMS[settings.algorithm].on_policy
        self.statistics = RunningStatistics(env.size)
        # A copy may already be better than what a short run makes of it.
        self.at = Progress(next_evaluation=settings.evaluate_every if settings.imitate is None else 0)
        self._started = time.monotonic()

    def begin(self) -> None:
        """Take what the model begins with: input statistics, another run's networks, a copy of a policy."""
        s = self.settings
        if s.start is None:
            first_statistics(s, self.statistics)
        else:
            inputs = self.env.encoding.names()
            checkpoint.start_from(Path(s.start), self.model, self.statistics, inputs, s.log_deviation)
        if s.imitate is not None:
            imitate(self.model, s, self.env.encoding, load(s.imitate), self.statistics, self.display.note)

    def restore(self, state: State) -> None:
        """Go back to where a checkpoint was written, or raise RunFolderError if it does not fit the settings."""
        try:
            self.env.restore(arrays_of(state["worlds"]))
            self.statistics.restore(state["statistics"])
            checkpoint.restore_model(self.model, state["model"])
            checkpoint.restore_random_state(state["random"])
            self.at = Progress(**state["progress"])
            self._started -= self.at.seconds
        except Exception as error:  # whatever a state of other settings raises
            raise RunFolderError(
                f"the checkpoint in {self.folder} does not fit its settings: {error!s:.300}. "
                "Restore settings.json, or start the training again in another --out"
            ) from error

    def _on_rollout_start(self) -> None:
        """Between the updates and the next rollout, where a run can be interrupted and resumed."""
        s, steps = self.settings, self.model.num_timesteps
        if s.final_log_deviation is not None and self.on_policy:
            limit = s.log_deviation + min(1.0, steps / s.steps) * (s.final_log_deviation - s.log_deviation)
            policy: Any = self.model.policy
            with torch.no_grad():
                policy.log_std.clamp_(max=limit)
        self._show()
        if self.on_policy or self.at.rollouts % _APPLY_EVERY == 0:
            self.statistics.apply(self.model.policy)
        if steps >= min(self.at.next_evaluation, self.at.next_checkpoint):
            self.check_finite()
        if steps >= self.at.next_evaluation:
            self._evaluate()
        if steps >= self.at.next_checkpoint:
            self.at.next_checkpoint = steps + s.checkpoint_every
            self._checkpoint()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        """Between a rollout and the updates: statistics and reward terms."""
        buffer = getattr(self.model, "rollout_buffer", None)
        if buffer is not None:
            self.statistics.add(buffer.observations[::_STATISTICS_EVERY])
        elif self.at.rollouts % _STATISTICS_EVERY == 0:
            self.statistics.add(np.asarray(self.model._last_obs))
        self.at.rollouts += 1
        for name, mean in self.env.take_terms().items():
            self.logger.record_mean(f"reward/{name}", mean)

    def finish(self) -> None:
        """Evaluate once more, and write the last policy and checkpoint."""
        self._show()
        self.statistics.apply(self.model.policy)
        self.check_finite()
        if not self.at.curve or self.at.curve[-1]["steps"] < self.model.num_timesteps:
            self._evaluate()
        self._checkpoint()
        self._policy().save(self.folder / LAST)  # once it is there, a league takes the training for ended

    def _evaluate(self) -> None:
        """Evaluate on the validation worlds; keep the policy if it is the best so far."""
        steps, every = self.model.num_timesteps, self.settings.evaluate_every
        self.at.next_evaluation = (steps // every + 1) * every
        point = {"steps": float(steps), "seconds": time.monotonic() - self._started}
        point |= validate(self.settings, self._policy())
        best = max((earlier["safe_score"] for earlier in self.at.curve), default=-1.0)
        self.at.curve.append(point)
        write_csv(self.folder / CURVE, self.at.curve)
        if point["safe_score"] > best:
            self._policy().save(self.folder / BEST)
        for name in ("safe_score", "score", "contact_free"):
            self.logger.record(f"validation/{name}", point[name])
        self.logger.dump(steps)  # now, so that they are logged at the step that they belong to
        self.display.evaluated(point)

    def _checkpoint(self) -> None:
        state = {
            "worlds": tensors_of(self.env.arrays()),
            "inputs": self.env.encoding.names(),
            "statistics": self.statistics.save(),
            "model": checkpoint.model_state(self.model),
            "random": checkpoint.random_state(),
            "progress": {**vars(self.at), "seconds": time.monotonic() - self._started},
        }
        checkpoint.write_checkpoint(self.folder, state)

    def _policy(self) -> Any:
        card = make_card(self.settings, steps=self.model.num_timesteps, curve=self.at.curve)
        return export(self.model, self.settings, self.env.encoding, card)

    def _show(self) -> None:
        episodes = self.model.ep_info_buffer or ()
        score = float(np.mean([e["score"] for e in episodes])) if episodes else None
        if score is not None:
            self.logger.record("training/score", score)
        self.display.progress(self.model.num_timesteps, score)

    def check_finite(self, cause: Exception | None = None) -> None:
        """Raise RunFolderError where networks hold numbers that are not finite, before they are evaluated or saved."""
        if all(bool(torch.isfinite(tensor).all()) for tensor in self.model.policy.state_dict().values()):
            return
        raise RunFolderError(
            f"the training diverged at {self.model.num_timesteps:,} steps: its networks give numbers that are not "
            f"finite; the checkpoint and {BEST} of before are kept, if there are any. Lower --learning-rate, or "
            "--log-deviation, and train again in another --out"
        ) from cause
