import gymnasium as gym
from stable_baselines3 import PPO

from posse_training import evaluate
from posse_training.sb3 import from_sb3

env = gym.make("posse:posse/Solo-v0", scenario="constant")
model = PPO("MlpPolicy", env, n_steps=256, device="cpu")
model.learn(512)  # some 10**6 to learn anything
model.save("solo.zip")
policy = from_sb3(PPO.load("solo.zip"))
results = evaluate(policy, "constant", episodes=20, num_trackers=1)
print(results.estimate("score"))
