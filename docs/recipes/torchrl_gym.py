import gymnasium as gym
from torchrl.envs import GymEnv, GymWrapper

if __name__ == "__main__":  # num_envs starts processes
    solo, smart = "posse:posse/Solo-v0", {"scenario": "smart"}
    print(GymEnv(solo, **smart).rollout(20)["observation"].shape)
    some = GymEnv(solo, num_envs=3, **smart)  # a process for each world
    seen = some.rollout(20, break_when_any_done=False)
    print(seen["next", "score"].shape)
    some.close()
    how = {"vectorization_mode": "vector_entry_point", **smart}
    how["autoreset"] = "same_step"
    envs = gym.make_vec("posse:posse/Team-v0", 16, **how)  # one call
    seen = GymWrapper(envs).rollout(20, break_when_any_done=False)
    print(seen["next", "score"].shape)
