"""PPO in one file, in the style of CleanRL, on torch and PettingZoo.

All trackers share one policy: python docs/tutorials/cleanrl_ppo.py
"""

import argparse
import time
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import save_file
from torch import nn
from torch.distributions import Normal

import posse

parser = argparse.ArgumentParser()
parser.add_argument("--scenario", default="constant")
parser.add_argument(
    "--steps", type=int, default=1_000_000, help="steps of a tracker"
)
parser.add_argument("--envs", type=int, default=8)
parser.add_argument(
    "--rollout", type=int, default=128, help="steps between two updates"
)
parser.add_argument("--epochs", type=int, default=4)
parser.add_argument("--minibatches", type=int, default=4)
parser.add_argument("--learning-rate", type=float, default=3e-4)
parser.add_argument("--discount", type=float, default=0.98)
parser.add_argument("--gae-lambda", type=float, default=0.95)
parser.add_argument("--clip", type=float, default=0.2)
parser.add_argument("--seed", type=int, default=1)
file = Path("runs/tutorials/cleanrl_ppo.safetensors")
parser.add_argument("--file", type=Path, default=file)
args = parser.parse_args()
torch.manual_seed(args.seed)
torch.set_num_threads(1)

# --- the environments, of N agents: a rollout has envs x N columns ----
# A small reward for holding a slot and a larger one for approaching it
# keep returns near 1.
weights = {"slot": 0.1, "progress": 0.5, "contact": -0.2}
how = {"scenario": args.scenario, "reward_weights": weights}
envs = [
    posse.parallel_env(**how, first_world=k) for k in range(args.envs)
]
agents = envs[0].possible_agents
inputs = envs[0].observation_space(agents[0]).shape[0]
outputs = envs[0].action_space(agents[0]).shape[0]
columns = len(envs) * len(agents)


def stacked(rows):
    """Rows of every agent of every environment, as one array."""
    stacked = np.stack([row[a] for row in rows for a in agents])
    return torch.as_tensor(stacked, dtype=torch.float32)


# --- policy and value function ----
def network(out, gain):
    last = nn.Linear(64, out)
    nn.init.orthogonal_(last.weight, gain)
    nn.init.zeros_(last.bias)
    first, second = nn.Linear(inputs, 64), nn.Linear(64, 64)
    return nn.Sequential(first, nn.Tanh(), second, nn.Tanh(), last)


class Agent(nn.Module):
    def __init__(self):
        super().__init__()
        self.policy = network(outputs, 0.01)
        self.critic = network(1, 1.0)
        self.log_deviation = nn.Parameter(torch.full((outputs,), -0.5))
        # Statistics of the observations are saved with the agent.
        self.register_buffer("mean", torch.zeros(inputs))
        self.register_buffer("square", torch.ones(inputs))
        self.register_buffer("count", torch.tensor(1e-4))

    def see(self, x):
        """Update the statistics with observations."""
        self.count += len(x)
        self.mean += (x - self.mean).sum(0) / self.count
        self.square += (x**2 - self.square).sum(0) / self.count

    def normal(self, x):
        deviation = (self.square - self.mean**2).clamp_min(1e-4).sqrt()
        return ((x - self.mean) / deviation).clamp(-5, 5)

    def choose(self, x):
        mean = self.policy(self.normal(x))
        return Normal(mean, self.log_deviation.exp())

    def value(self, x):
        return self.critic(self.normal(x)).squeeze(-1)


agent = Agent()
optimizer = torch.optim.Adam(
    agent.parameters(), lr=args.learning_rate, eps=1e-5
)

# --- learning ----
shape = (args.rollout, columns)
seen = torch.zeros((*shape, inputs))
acted = torch.zeros((*shape, outputs))
log_probabilities, rewards, values = torch.zeros((3, *shape))
# Value of what follows; last of an episode.
nexts, ends = torch.zeros((2, *shape))
observation = stacked([env.reset(seed=args.seed)[0] for env in envs])
scores, done, started = [], 0, time.time()

while done < args.steps:
    for t in range(args.rollout):
        with torch.no_grad():
            choice = agent.choose(observation)
            action = choice.sample()
            values[t] = agent.value(observation)
        seen[t], acted[t] = observation, action
        log_probabilities[t] = choice.log_prob(action).sum(-1)
        bounded = action.clamp(-1, 1).numpy()
        bounded = bounded.reshape(len(envs), len(agents), outputs)
        rows = []
        for k, env in enumerate(envs):
            moves = dict(zip(agents, bounded[k], strict=True))
            row, reward, terminated, truncated, infos = env.step(moves)
            mine = slice(k * len(agents), (k + 1) * len(agents))
            rewards[t, mine] = torch.tensor([reward[a] for a in agents])
            # A truncated episode is bootstrapped from its last row.
            with torch.no_grad():
                alive = 1.0 - float(terminated[agents[0]])
                nexts[t, mine] = alive * agent.value(stacked([row]))
            over = terminated[agents[0]] or truncated[agents[0]]
            ends[t, mine] = float(over)
            if over:
                scores.append(infos[agents[0]]["metrics/score"])
                row, _ = env.reset()
            rows.append(row)
        observation = stacked(rows)
        done += columns

    # Generalized advantage estimation, cut at the ends of episodes.
    advantages, advantage = torch.zeros(shape), torch.zeros(columns)
    for t in reversed(range(args.rollout)):
        error = rewards[t] + args.discount * nexts[t] - values[t]
        fade = args.discount * args.gae_lambda * (1 - ends[t])
        advantage = error + fade * advantage
        advantages[t] = advantage
    returns = (advantages + values).flatten()
    flat_seen, flat_acted = seen.flatten(0, 1), acted.flatten(0, 1)
    flat_log = log_probabilities.flatten()
    flat_advantages = advantages.flatten()

    for _ in range(args.epochs):
        order = torch.randperm(len(returns))
        for rows in order.chunk(args.minibatches):
            choice = agent.choose(flat_seen[rows])
            log = choice.log_prob(flat_acted[rows]).sum(-1)
            ratio = (log - flat_log[rows]).exp()
            weight = flat_advantages[rows]
            weight = (weight - weight.mean()) / (weight.std() + 1e-8)
            clipped = ratio.clamp(1 - args.clip, 1 + args.clip)
            least = torch.min(ratio * weight, clipped * weight)
            policy_loss = -least.mean()
            missed = agent.value(flat_seen[rows]) - returns[rows]
            value_loss = missed.square().mean()
            optimizer.zero_grad()
            (policy_loss + 0.5 * value_loss).backward()
            # Clipped separately, or large gradients of the critic would
            # scale down the policy's.
            own = [*agent.policy.parameters(), agent.log_deviation]
            nn.utils.clip_grad_norm_(own, 0.5)
            nn.utils.clip_grad_norm_(agent.critic.parameters(), 0.5)
            optimizer.step()
    agent.see(flat_seen)  # not within a rollout, of one policy

    recent = f"{np.mean(scores[-20:]):.3f}" if scores else "-"
    rate = done / (time.time() - started)
    shown = f"score {recent}  reward {rewards.mean():.4f}"
    print(f"{done:>9,} steps  {shown}  {rate:,.0f} steps/s")

args.file.parent.mkdir(parents=True, exist_ok=True)
save_file(agent.state_dict(), args.file)
print(f"{args.file}")
