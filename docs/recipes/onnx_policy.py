"""The learned target as ONNX does in an episode what the policy does."""

import numpy as np
import onnxruntime

import posse
from posse_baselines import load, load_target
from posse_training.commands.export import export

evader = load_target("evader").policy
export(evader, "evader.onnx")
network = onnxruntime.InferenceSession("evader.onnx")
batch = posse.batch("duel", 1, split="test", team_policy=load("pursuit"))
observations, memory, over = batch.reset(), evader.begin(batch.layout, 1), False
while not over:
    (actions,) = network.run(["action"], {"observation": observations[0]})
    wanted, memory = evader.act(observations, memory)
    np.testing.assert_allclose(actions, wanted[0], atol=1e-5)
    observations, _, terminated, truncated, _ = batch.step(actions[None])
    over = (terminated | truncated).any()
print("equal to 1e-5 in every step")
