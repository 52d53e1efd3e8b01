import gymnasium as gym
from sb3_contrib import TQC
from stable_baselines3 import SAC

from posse_baselines import load
from posse_training import evaluate
from posse_training.sb3 import from_sb3

few = {"episodes": 5, "horizon": 100}
env = gym.make("posse:posse/Team-v0")
team = TQC("MlpPolicy", env, device="cpu").learn(150)
played = evaluate(from_sb3(team), "constant", **few)
print(played.estimate("score"))
env = gym.make("posse/Tracker-v0")
tracker = SAC("MlpPolicy", env, device="cpu").learn(150)
size = load("ddcs-distributed").message_size  # of its team-mates
clones = from_sb3(tracker, message_size=size)
print(evaluate(clones, "constant", **few).estimate("score"))
