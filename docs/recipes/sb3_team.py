import gymnasium as gym
from sb3_contrib import TQC
from stable_baselines3 import SAC

from posse_baselines import load
from posse_training import evaluate
from posse_training.sb3 import from_sb3

team = TQC("MlpPolicy", gym.make("posse:posse/Team-v0"), device="cpu").learn(150)
print(evaluate(from_sb3(team), "constant", episodes=5, horizon=100).estimate("score"))
tracker = SAC("MlpPolicy", gym.make("posse/Tracker-v0"), device="cpu").learn(150)
said = load("ddcs-distributed").message_size  # its team-mates' messages were observed, too
clones = from_sb3(tracker, message_size=said)
print(evaluate(clones, "constant", episodes=5, horizon=100).estimate("score"))
