import torch

from posse_baselines import from_function
from posse_training import evaluate
from posse_training.datasets import record_dataset

data = record_dataset("pursuit", "constant", episodes=5, out="datasets")
played = list(data)
x = torch.cat([torch.tensor(e.observations[:-1]) for e in played])
y = torch.cat([torch.tensor(e.actions) for e in played])
x, y = x.flatten(0, 1), y.flatten(0, 1)
layers = torch.nn.Linear(x.shape[1], 64), torch.nn.Linear(64, 2)
net = torch.nn.Sequential(layers[0], torch.nn.Tanh(), layers[1])
optimizer = torch.optim.Adam(net.parameters(), 1e-3)
for _ in range(100):  # behaviour cloning
    loss = torch.nn.functional.mse_loss(net(x), y)
    optimizer.zero_grad(), loss.backward(), optimizer.step()


def act(observations):
    actions = net(torch.as_tensor(observations)).detach()
    return actions.clamp(-1, 1).numpy()


clone = from_function(act)
print(evaluate(clone, "constant", episodes=5).estimate("score"))
