from skrl.envs.wrappers.torch import wrap_env
from skrl.utils.runner.torch import Runner

import posse

net = {"name": "net", "layers": [64, 64], "activations": "tanh"}
kinds = ("observation_preprocessor", "state_preprocessor")
kinds += ("value_preprocessor", "learning_rate_scheduler")
for name, seen in {"IPPO": "OBSERVATIONS", "MAPPO": "STATES"}.items():
    env = posse.parallel_env("smart", clip_actions=True)
    env = wrap_env(env, wrapper="pettingzoo")
    policy = {"class": "GaussianMixin", "output": "ACTIONS"}
    policy["network"] = [{"input": "OBSERVATIONS", **net}]
    value = {"class": "DeterministicMixin", "output": "ONE"}
    value["network"] = [{"input": seen, **net}]
    agent = {"class": name, "rollouts": 64, "learning_epochs": 2}
    agent["experiment"] = {"write_interval": 0}
    for kind in kinds:  # skrl 2.1 wants them
        agent[f"{kind}_kwargs"] = {a: {} for a in env.possible_agents}
    parts = {
        "models": {"separate": True, "policy": policy, "value": value},
        "memory": {"class": "RandomMemory", "memory_size": -1},
        "trainer": {"class": "SequentialTrainer", "timesteps": 128},
        "agent": agent,
    }
    Runner(env, parts).run()
