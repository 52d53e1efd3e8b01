from posse_training.torchrl import PosseEnv

env = PosseEnv("smart", num_worlds=16, state=True, discrete_actions=True)
rollout = env.rollout(20, break_when_any_done=False)
print(rollout["agents", "observation"].shape)  # (16 worlds, 20 steps, 5 trackers, fields)
print(rollout["state"].shape)  # (16, 20, numbers), for a centralized critic
