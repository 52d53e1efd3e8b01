import posse
from posse_baselines import load, split_agents, stack_agents

policy = load("ddcs-distributed")
env = posse.parallel_env("smart", message_size=policy.message_size)
observations, info = env.reset(seed=1)
memory = policy.begin(env.layout, 1)
while env.agents:
    actions, memory = policy.act(stack_agents(observations), memory)
    observations, *_, info = env.step(split_agents(actions, env.agents))
print(info["tracker_0"]["metrics/safe_score"])
