from agilerl.algorithms import IPPO
from agilerl.training import train_multi_agent_on_policy as training
from agilerl.vector.pz_async_vec_env import AsyncPettingZooVecEnv

import posse


def make():
    how = {"num_trackers": 3, "clip_actions": True}
    return posse.parallel_env("smart", **how)


if __name__ == "__main__":  # starts processes
    one, envs = make(), AsyncPettingZooVecEnv([make, make])
    agent = IPPO(
        [one.observation_space(name) for name in one.possible_agents],
        [one.action_space(name) for name in one.possible_agents],
        agent_ids=one.possible_agents,
        learn_step=64,
        batch_size=32,
        update_epochs=1,
    )
    few = {"max_steps": 128, "evo_steps": 128, "eval_steps": 8}
    train = training.train_multi_agent_on_policy
    train(envs, "posse", "IPPO", [agent], **few)
    envs.close()
