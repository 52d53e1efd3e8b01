import gymnasium as gym
from sb3_contrib import RecurrentPPO

from posse_training import evaluate
from posse_training.sb3 import from_sb3

env = gym.make("posse:posse/Solo-v0", scenario="radio")
model = RecurrentPPO("MlpLstmPolicy", env, n_steps=128, device="cpu")
model.learn(256)  # some 10**6 to learn anything
few = {"episodes": 5, "num_trackers": 1, "horizon": 100}
results = evaluate(from_sb3(model), "radio", **few)
print(results.estimate("score"))
