"""The learned target as ONNX does what the policy does."""

import numpy as np
import onnxruntime

import posse
from posse_baselines import load, load_target
from posse_training.commands.export import export

evader = load_target("evader").policy
export(evader, "evader.onnx")
network = onnxruntime.InferenceSession("evader.onnx")
team = load("pursuit")
batch = posse.batch("duel", split="test", team_policy=team)
observations, over = batch.reset(), False
memory = evader.begin(batch.layout, 1)
while not over:
    seen = {"observation": observations[0]}
    (actions,) = network.run(["action"], seen)
    wanted, memory = evader.act(observations, memory)
    np.testing.assert_allclose(actions, wanted[0], atol=1e-5)
    observations, _, ended, cut, _ = batch.step(actions[None])
    over = (ended | cut).any()
print("equal to 1e-5 in every step")
