from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune import register_env

import posse

register_env("posse", lambda s: ParallelPettingZooEnv(posse.parallel_env("smart", **s)))
config = PPOConfig().environment("posse", env_config={"target_motion": "agent"})
config.env_runners(num_env_runners=1)  # processes that play; across a Ray cluster if there is one
kinds = {"tracker", "target"}  # one policy for all trackers, one for the target
config.multi_agent(policies=kinds, policy_mapping_fn=lambda agent, _: agent.split("_")[0])
config.training(train_batch_size=400, minibatch_size=200, num_epochs=1)
algorithm = config.build_algo()
print(algorithm.train()["env_runners"]["num_env_steps_sampled"])
algorithm.stop()
