import gymnasium as gym
from torchrl.envs import GymEnv, GymWrapper

if __name__ == "__main__":  # num_envs starts processes
    settings = {"scenario": "smart"}
    print(GymEnv("posse:posse/Solo-v0", **settings).rollout(20)["observation"].shape)
    some = GymEnv("posse:posse/Solo-v0", num_envs=3, **settings)  # a process for each world
    print(some.rollout(20, break_when_any_done=False)["next", "score"].shape)
    some.close()
    how = {"vectorization_mode": "vector_entry_point", "autoreset": "same_step"}
    envs = gym.make_vec("posse:posse/Team-v0", 16, **how, **settings)  # stepped by one call
    print(GymWrapper(envs).rollout(20, break_when_any_done=False)["next", "score"].shape)
