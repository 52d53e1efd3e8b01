from skrl.envs.wrappers.torch import wrap_env
from skrl.utils.runner.torch import Runner

import posse

env = wrap_env(posse.parallel_env("smart", clip_actions=True), wrapper="pettingzoo")
own = {"network": [{"name": "net", "input": "OBSERVATIONS", "layers": [64, 64], "activations": "tanh"}]}
actor = {"class": "GaussianMixin", "output": "ACTIONS", **own}
critic = {"class": "DeterministicMixin", "output": "ONE", "network": [{**own["network"][0], "input": "STATES"}]}
kinds = ("learning_rate_scheduler", "observation_preprocessor", "state_preprocessor", "value_preprocessor")
agent = {f"{kind}_kwargs": {agent: {} for agent in env.possible_agents} for kind in kinds}  # skrl 2.1 wants them
agent |= {"class": "MAPPO", "rollouts": 64, "learning_epochs": 2, "experiment": {"write_interval": 0}}
rest = {"memory": {"class": "RandomMemory", "memory_size": -1}, "agent": agent}
trainer = {"class": "SequentialTrainer", "timesteps": 128}
Runner(env, {"models": {"separate": True, "policy": actor, "value": critic}, "trainer": trainer, **rest}).run()
