import gymnasium as gym
from torchrl.envs import GymEnv, GymWrapper

one = GymEnv("posse:posse/Solo-v0", scenario="smart")
print(one.rollout(20)["observation"].shape)
for name in ("posse:posse/Team-v0", "posse:posse/Solo-v0"):  # 16 worlds, stepped by one call
    envs = gym.make_vec(
        name, 16, vectorization_mode="vector_entry_point", scenario="smart", autoreset="disabled"
    )
    many = GymWrapper(envs)
    print(many.rollout(20, break_when_any_done=False)["observation"].shape)
