import supersuit
from stable_baselines3 import PPO

import posse

env = posse.parallel_env("smart")
env = supersuit.agent_indicator_v0(supersuit.normalize_obs_v0(env))
env = supersuit.pettingzoo_env_to_vec_env_v1(env)
how = {"num_cpus": 1, "base_class": "stable_baselines3"}
envs = supersuit.concat_vec_envs_v1(env, 2, **how)
how = {"n_steps": 32, "batch_size": 160, "device": "cpu"}
model = PPO("MlpPolicy", envs, **how).learn(320)
