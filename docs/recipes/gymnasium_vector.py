import gymnasium as gym
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import posse_baselines  # noqa: F401  registers posse/Tracker-v0

envs = gym.make_vec(
    "posse/Tracker-v0",
    64,
    vectorization_mode="vector_entry_point",
    scenario="smart",
    number=0,
    teammates="ddcs-distributed",
    autoreset="same_step",
)
envs = RecordEpisodeStatistics(envs)
observations, infos = envs.reset(seed=1)
actions = envs.action_space.sample()
observations, rewards, terminated, truncated, infos = envs.step(actions)
