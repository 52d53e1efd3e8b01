from stable_baselines3 import PPO

import posse
from posse_baselines.learned import Encoding
from posse_training import evaluate
from posse_training.sb3 import TeamVecEnv, from_sb3

batch = posse.batch("smart", num_worlds=8, autoreset="disabled")
encoding = Encoding.of(batch.layout)
# 8 worlds of 5 trackers: 40 environments, and one policy, whose
# actions are velocities behind the safeguard.
env = TeamVecEnv([batch], encoding, safeguard=True)
how = {"n_steps": 32, "batch_size": 320, "device": "cpu"}
model = PPO("MlpPolicy", env, **how).learn(2560)
policy = from_sb3(model, encoding=encoding, safeguard=True)
print(evaluate(policy, "smart", episodes=10).estimate("score"))
