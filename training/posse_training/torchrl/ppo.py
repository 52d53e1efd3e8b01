"""PPO on TorchRL over a batch of worlds: one policy for all trackers, torch from end to end.

Reads top to bottom in the order in which it runs. Every tensor stays on one device, the CPU or
another. Each tracker learns from its own observations and rewards (independent PPO with shared
weights); E = worlds, N = trackers, T = steps of a rollout.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any, Final

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import (
    AddStateIndependentNormalScale,
    TensorDictModule,
    TensorDictSequential,
)
from torch import nn
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.modules import (
    IndependentNormal,
    ProbabilisticActor,
    ValueOperator,
)
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from posse_training.torchrl.env import TRACKERS, PosseEnv

OBSERVATION: Final = (TRACKERS, "observation")
ACTION: Final = (TRACKERS, "action")
DRAWN: Final = (TRACKERS, "drawn")
"""What the policy drew from its normal distribution; the action is that, cut to [-1, 1]."""
REWARD: Final = (TRACKERS, "reward")
REWARD_NEXT: Final = ("next", *REWARD)
LOG_PROBABILITY: Final = (TRACKERS, "action_log_prob")
VALUE: Final = (TRACKERS, "state_value")
LOSSES: Final = ("loss_objective", "loss_critic", "loss_entropy")


@dataclass(frozen=True)
class Settings:
    """How to learn.

    Raises:
        ValueError: A setting that nothing can be learnt with.
    """

    num_worlds: int = 1024
    rollout_steps: int = 32
    """T, steps between two updates."""
    updates: int = 60
    """Rollouts to learn from; agent-steps in all are updates x T x E x N."""
    epochs: int = 4
    """Passes over a rollout."""
    minibatches: int = 8
    """Parts that a pass is split into."""
    learning_rate: float = 3e-4
    discount: float = 0.99
    trace: float = 0.95
    """λ of generalised advantage estimation."""
    clip: float = 0.2
    """How far the ratio of probabilities may leave 1."""
    entropy: float = 0.001
    """Weight of the entropy bonus."""
    gradient_norm: float = 0.5
    """Greatest norm of a gradient."""
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
                raise ValueError(f"{name}={value!r} is not possible: it must be {allowed}")


class RunningScale(nn.Module):
    """Brings observations (..., F) to mean 0 and deviation 1, by all that has been seen.

    The statistics are part of the weights, so that a policy is never played with others.
    """

    mean: torch.Tensor
    variance: torch.Tensor
    count: torch.Tensor

    def __init__(self, size: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("variance", torch.ones(size))
        self.register_buffer("count", torch.zeros(()))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the observations scaled, within ±10."""
        return ((observations - self.mean) / (self.variance + 1e-8).sqrt()).clamp(-10.0, 10.0)

    @torch.no_grad()
    def update(self, observations: torch.Tensor) -> None:
        """Take more observations into account (Chan, Golub and LeVeque's pairwise form)."""
        flat = observations.reshape(-1, observations.shape[-1])
        new, total = len(flat), self.count + len(flat)
        apart = flat.mean(0) - self.mean
        squares = self.variance * self.count + flat.var(0, correction=0) * new
        self.variance.copy_((squares + apart**2 * self.count * new / total) / total)
        self.mean.add_(apart * new / total)
        self.count.copy_(total)


class Agent(nn.Module):
    """The policy and the critic of every tracker.

    Attributes:
        actor: Adds what it draws, and the log-probability of that, to a tensordict.
        critic: Adds values.
        scale: What both see observations through.
    """

    def __init__(self, env: PosseEnv, hidden: tuple[int, ...]) -> None:
        super().__init__()
        size = env.observation_spec[OBSERVATION].shape[-1]
        width = env.full_action_spec[ACTION].shape[-1]
        self.scale = RunningScale(size)
        policy = nn.Sequential(
            self.scale, *_layers(size, hidden, width, 0.01), AddStateIndependentNormalScale(width)
        )
        value = nn.Sequential(self.scale, *_layers(size, hidden, 1, 1.0))
        parameters = [(TRACKERS, "loc"), (TRACKERS, "scale")]
        self.actor = ProbabilisticActor(
            TensorDictModule(policy, [OBSERVATION], parameters),
            in_keys=parameters,
            out_keys=[DRAWN],
            distribution_class=IndependentNormal,
            return_log_prob=True,
            log_prob_key=LOG_PROBABILITY,
        )
        self.critic = ValueOperator(value, in_keys=[OBSERVATION], out_keys=[VALUE])


def _layers(size: int, hidden: tuple[int, ...], out: int, gain: float) -> list[nn.Module]:
    """Return a perceptron's layers; ``gain`` scales the last one's weights at the start."""
    layers: list[nn.Module] = []
    for width in hidden:
        layers += [_linear(size, width, 2**0.5), nn.Tanh()]
        size = width
    return [*layers, _linear(size, out, gain)]


def _linear(size: int, width: int, gain: float) -> nn.Linear:
    layer = nn.Linear(size, width)
    nn.init.orthogonal_(layer.weight, gain)
    nn.init.zeros_(layer.bias)
    return layer


@torch.no_grad()
def roll_out(
    env: PosseEnv, actor: TensorDictSequential, carried: TensorDictBase, steps: int
) -> tuple[TensorDictBase, TensorDictBase]:
    """Play for some steps; return them (E, T), and what the next rollout goes on from."""
    made = []
    for _ in range(steps):
        with set_exploration_type(ExplorationType.RANDOM):  # an actor plays its means otherwise
            carried = actor(carried)
        carried[ACTION] = carried[DRAWN].clamp(-1.0, 1.0)
        made_step, carried = env.step_and_maybe_reset(carried)
        made.append(made_step)
    return torch.stack(made, dim=1), carried


def spread_flags(rollout: TensorDictBase) -> None:
    """Give every tracker its world's flags, (E, T, N, 1), beside its reward.

    Truncated stays apart from terminated: at a truncation the value of what comes next counts.
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
    """Learn to play a scenario.

    Args:
        scenario: A scenario's name.
        settings: How to learn.
        device: Where everything lives; on ``"cuda"`` the worlds too (:class:`PosseEnv`).
        report: Given the figures of each update: ``score`` (mean over the rollout's steps),
            ``reward``, the losses, ``gradient_norm``, ``agent_steps`` so far.
        overrides: Settings of the scenario.

    The same seed gives the same agent on the same device.
    """
    settings = settings or Settings()
    torch.manual_seed(settings.seed)
    env = PosseEnv(scenario, settings.num_worlds, seed=settings.seed, device=device, **overrides)
    agent = Agent(env, settings.hidden).to(device)
    loss, advantage = objectives(agent, settings)
    optimizer = torch.optim.Adam(agent.parameters(), settings.learning_rate)

    carried = env.reset()
    # An episode to look around in: what is the same in every world at the start is not later on.
    for _ in range(0, env.batch.scenario.horizon, settings.rollout_steps):
        rollout, carried = roll_out(env, agent.actor, carried, settings.rollout_steps)
        agent.scale.update(rollout[OBSERVATION])
    agent_steps = 0
    for _ in range(settings.updates):
        rollout, carried = roll_out(env, agent.actor, carried, settings.rollout_steps)
        agent_steps += rollout[REWARD_NEXT].numel()
        figures = learn(agent, rollout, loss, advantage, optimizer, settings)
        # After learning, so that the actions are judged as they were when they were chosen.
        agent.scale.update(rollout[OBSERVATION])
        if report is not None:
            report({**figures, "agent_steps": float(agent_steps)})
    return agent


def objectives(agent: Agent, settings: Settings) -> tuple[ClipPPOLoss, GAE]:
    """Return the loss and the estimate of advantages, told where each tracker's numbers lie."""
    loss = ClipPPOLoss(
        agent.actor,
        agent.critic,
        clip_epsilon=settings.clip,
        entropy_coeff=settings.entropy,
    )
    loss.set_keys(
        action=DRAWN,
        sample_log_prob=LOG_PROBABILITY,
        value=VALUE,
        reward=REWARD,
        done=(TRACKERS, "done"),
        terminated=(TRACKERS, "terminated"),
    )
    advantage = GAE(gamma=settings.discount, lmbda=settings.trace, value_network=agent.critic)
    advantage.set_keys(
        value=VALUE,
        reward=REWARD,
        done=(TRACKERS, "done"),
        terminated=(TRACKERS, "terminated"),
    )
    return loss, advantage


def learn(
    agent: Agent,
    rollout: TensorDictBase,
    loss: ClipPPOLoss,
    advantage: GAE,
    optimizer: torch.optim.Optimizer,
    settings: Settings,
) -> dict[str, float]:
    """Improve the agent by a rollout (E, T); return the figures to report."""
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
    """Yield the parts of every pass over the steps (E T,), each pass in an order of its own."""
    for _ in range(settings.epochs):
        order = torch.randperm(len(steps), device=steps.device)
        for chosen in order.chunk(settings.minibatches):
            yield steps[chosen]
