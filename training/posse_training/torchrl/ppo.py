"""PPO on TorchRL over a batch of worlds: one policy for all trackers, torch from end to end.

The file reads in the order it runs. All tensors stay on one device. Each tracker learns from its
own observations and rewards (independent PPO with shared weights); E = worlds, N = trackers, T =
steps of a rollout.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictSequential
from torch import nn
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from posse_training.torchrl.agent import (
    ACTION,
    DRAWN,
    LOG_PROBABILITY,
    LOSSES,
    OBSERVATION,
    REWARD,
    REWARD_NEXT,
    VALUE,
    Agent,
)
from posse_training.torchrl.env import TRACKERS, PosseEnv


@dataclass(frozen=True)
class Settings:
    """Settings of a training run.

    Raises:
        ValueError: A setting out of its range.
    """

    num_worlds: int = 1024
    rollout_steps: int = 32
    """T, steps between two updates."""
    updates: int = 60
    """Number of rollouts; agent-steps in all are updates x T x E x N."""
    epochs: int = 4
    """Passes over a rollout."""
    minibatches: int = 8
    """Minibatches of a pass."""
    learning_rate: float = 3e-4
    discount: float = 0.99
    trace: float = 0.95
    """λ of generalised advantage estimation."""
    clip: float = 0.2
    """Largest deviation of the probability ratio from 1."""
    entropy: float = 0.001
    """Weight of the entropy bonus."""
    gradient_norm: float = 0.5
    """Largest norm of a gradient."""
    hidden: tuple[int, ...] = (64, 64)
    seed: int = 0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if name in ("seed", "entropy"):
                allowed, right = "at least 0", value >= 0
            elif name in ("discount", "trace"):
                allowed, right = "in [0, 1]", 0 <= value <= 1
            elif name == "hidden":
                allowed, right = "sizes above 0", all(size > 0 for size in value)
            else:
                allowed, right = "above 0", value > 0
            if not right:
                raise ValueError(f"{name}={value!r} is invalid: it must be {allowed}")


@torch.no_grad()
def roll_out(
    env: PosseEnv, actor: TensorDictSequential, carried: TensorDictBase, steps: int
) -> tuple[TensorDictBase, TensorDictBase]:
    """Play some steps; return them (E, T), and the tensordict that the next rollout starts from."""
    made = []
    for _ in range(steps):
        with set_exploration_type(ExplorationType.RANDOM):  # otherwise the actor returns its means
            carried = actor(carried)
        carried[ACTION] = carried[DRAWN].clamp(-1.0, 1.0)
        made_step, carried = env.step_and_maybe_reset(carried)
        made.append(made_step)
    return torch.stack(made, dim=1), carried


def spread_flags(rollout: TensorDictBase) -> None:
    """Copy each world's flags to its trackers, (E, T, N, 1), beside their rewards.

    Truncation stays distinct from termination: a truncated step is bootstrapped.
    """
    shape = rollout[REWARD_NEXT].shape
    for flag in ("done", "terminated"):
        flags = rollout["next", flag].unsqueeze(-2).expand(shape)
        rollout.set(("next", TRACKERS, flag), flags)


def train(
    scenario: str,
    settings: Settings | None = None,
    *,
    device: torch.device | str = "cpu",
    report: Callable[[dict[str, float]], None] | None = None,
    **overrides: Any,
) -> Agent:
    """Train an agent on a scenario.

    Args:
        scenario: A scenario's name.
        settings: Settings of the run.
        device: Device of all tensors (:class:`PosseEnv`).
        report: Called with the figures of each update: ``score`` (mean over the rollout's steps),
            ``reward``, the losses, ``gradient_norm``, ``agent_steps`` so far.
        overrides: Settings of the scenario.

    Returns:
        The agent; the same seed gives the same agent on the same device.
    """
    settings = settings or Settings()
    torch.manual_seed(settings.seed)
    env = PosseEnv(scenario, settings.num_worlds, seed=settings.seed, device=device, **overrides)
    agent = Agent(env, settings.hidden).to(device)
    loss, advantage = objectives(agent, settings)
    optimizer = torch.optim.Adam(agent.parameters(), settings.learning_rate)

    carried = env.reset()
    # Input statistics of a whole episode: early steps are much the same in every world.
    for _ in range(0, env.batch.scenario.horizon, settings.rollout_steps):
        rollout, carried = roll_out(env, agent.actor, carried, settings.rollout_steps)
        agent.scale.update(rollout[OBSERVATION])
    agent_steps = 0
    for _ in range(settings.updates):
        rollout, carried = roll_out(env, agent.actor, carried, settings.rollout_steps)
        agent_steps += rollout[REWARD_NEXT].numel()
        figures = learn(agent, rollout, loss, advantage, optimizer, settings)
        # After the update, which must use the statistics that the actions were sampled with.
        agent.scale.update(rollout[OBSERVATION])
        if report is not None:
            report({**figures, "agent_steps": float(agent_steps)})
    return agent


def objectives(agent: Agent, settings: Settings) -> tuple[ClipPPOLoss, GAE]:
    """Return the loss and the advantage estimator, with the keys of the trackers' tensors."""
    loss = ClipPPOLoss(agent.actor, agent.critic, clip_epsilon=settings.clip, entropy_coeff=settings.entropy)
    loss.set_keys(
        action=DRAWN,
        sample_log_prob=LOG_PROBABILITY,
        value=VALUE,
        reward=REWARD,
        done=(TRACKERS, "done"),
        terminated=(TRACKERS, "terminated"),
    )
    advantage = GAE(gamma=settings.discount, lmbda=settings.trace, value_network=agent.critic)
    advantage.set_keys(value=VALUE, reward=REWARD, done=(TRACKERS, "done"), terminated=(TRACKERS, "terminated"))
    return loss, advantage


def learn(
    agent: Agent,
    rollout: TensorDictBase,
    loss: ClipPPOLoss,
    advantage: GAE,
    optimizer: torch.optim.Optimizer,
    settings: Settings,
) -> dict[str, float]:
    """Update the agent with a rollout (E, T); return the figures to report."""
    spread_flags(rollout)
    with torch.no_grad():
        advantage(rollout)
        gain = rollout["advantage"]
        rollout["advantage"] = (gain - gain.mean()) / (gain.std() + 1e-8)
    sums: dict[str, torch.Tensor] = {}
    count = 0
    for part in parts_of(rollout.reshape(-1), settings):
        losses: TensorDict = loss(part)
        total = torch.stack([losses[name] for name in LOSSES]).sum()
        optimizer.zero_grad()
        total.backward()  # type: ignore[no-untyped-call]
        norm = nn.utils.clip_grad_norm_(agent.parameters(), settings.gradient_norm)
        optimizer.step()
        for name in LOSSES:
            sums[name] = sums.get(name, torch.zeros_like(norm)) + losses[name].detach()
        sums["gradient_norm"] = sums.get("gradient_norm", torch.zeros_like(norm)) + norm
        count += 1
    return {
        "score": rollout["next", "score"].mean().item(),
        "reward": rollout[REWARD_NEXT].mean().item(),
        **{name: (total / count).item() for name, total in sums.items()},
    }


def parts_of(steps: TensorDictBase, settings: Settings) -> Iterator[TensorDictBase]:
    """Yield the minibatches of all passes over the steps (E T,), each pass in random order."""
    for _ in range(settings.epochs):
        order = torch.randperm(len(steps), device=steps.device)
        for chosen in order.chunk(settings.minibatches):
            yield steps[chosen]
