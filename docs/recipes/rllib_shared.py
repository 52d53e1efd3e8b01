from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.env.wrappers import pettingzoo_env
from ray.tune import register_env

import posse


def make(settings):
    env = posse.parallel_env("smart", **settings)
    return pettingzoo_env.ParallelPettingZooEnv(env)


register_env("posse", make)
config = PPOConfig()
config.environment("posse", env_config={"target_motion": "agent"})
config.env_runners(num_env_runners=1)  # processes that play, or Ray's
config.multi_agent(
    policies={"tracker", "target"},  # one for all trackers
    policy_mapping_fn=lambda agent, _: agent.split("_")[0],
)
config.training(train_batch_size=400, minibatch_size=200, num_epochs=1)
algorithm = config.build_algo()
print(algorithm.train()["env_runners"]["num_env_steps_sampled"])
algorithm.stop()
