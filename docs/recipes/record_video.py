import gymnasium as gym
from gymnasium.wrappers import RecordVideo

env = gym.make("posse:posse/Team-v0", scenario="smart", render_mode="rgb_array", horizon=40)
env = RecordVideo(env, "videos", name_prefix="team")
env.reset(seed=1)
done = False
while not done:
    *_, terminated, truncated, info = env.step(env.action_space.sample())
    done = terminated or truncated
env.close()
print(info["metrics/score"])
