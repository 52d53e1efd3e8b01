import torch

from posse_baselines import from_function
from posse_training import evaluate
from posse_training.datasets import record_dataset

data = record_dataset("pursuit", "constant", episodes=5, out="datasets")
x = torch.cat([torch.tensor(e.observations[:-1]).flatten(0, 1) for e in data])
y = torch.cat([torch.tensor(e.actions).flatten(0, 1) for e in data])
net = torch.nn.Sequential(torch.nn.Linear(x.shape[1], 64), torch.nn.Tanh(), torch.nn.Linear(64, 2))
optimizer = torch.optim.Adam(net.parameters(), 1e-3)
for _ in range(100):  # behaviour cloning
    loss = torch.nn.functional.mse_loss(net(x), y)
    optimizer.zero_grad(), loss.backward(), optimizer.step()
clone = from_function(lambda o: net(torch.as_tensor(o)).detach().clamp(-1, 1).numpy())
print(evaluate(clone, "constant", episodes=5).estimate("score"))
