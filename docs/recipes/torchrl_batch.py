from posse_training.torchrl import PosseEnv

how = {"num_worlds": 16, "state": True, "discrete_actions": True}
env = PosseEnv("smart", **how)
rollout = env.rollout(20, break_when_any_done=False)
seen = rollout["agents", "observation"]
print(seen.shape)  # (16 worlds, 20 steps, 5 trackers, fields)
print(rollout["state"].shape)  # (16, 20, numbers), for a critic
