import gymnasium as gym
from gymnasium.wrappers import RecordVideo

how = {"render_mode": "rgb_array", "horizon": 40}
env = gym.make("posse:posse/Team-v0", scenario="smart", **how)
env = RecordVideo(env, "videos", name_prefix="team")
env.reset(seed=1)
done = False
while not done:
    action = env.action_space.sample()
    *_, terminated, truncated, info = env.step(action)
    done = terminated or truncated
env.close()
print(info["metrics/score"])
