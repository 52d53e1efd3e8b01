from agilerl.algorithms import IPPO
from agilerl.training.train_multi_agent_on_policy import train_multi_agent_on_policy
from agilerl.vector.pz_async_vec_env import AsyncPettingZooVecEnv

import posse


def make():
    return posse.parallel_env("smart", num_trackers=3, clip_actions=True)


if __name__ == "__main__":  # starts processes
    one, envs = make(), AsyncPettingZooVecEnv([make, make])
    spaces = [one.observation_space(a) for a in one.possible_agents], [one.action_space(a) for a in one.possible_agents]
    agent = IPPO(*spaces, agent_ids=one.possible_agents, learn_step=64, batch_size=32, update_epochs=1)
    train_multi_agent_on_policy(envs, "posse", "IPPO", [agent], max_steps=128, evo_steps=128, eval_steps=8)
    envs.close()
