from functools import partial

import gymnasium
import pufferlib.vector
from pufferlib.emulation import GymnasiumPufferEnv, PettingZooPufferEnv

import posse

settings = {"scenario": "smart", "discrete_actions": True}
one = partial(gymnasium.make, "posse/Solo-v0", **settings)
team = partial(posse.parallel_env, **settings)
kinds = (GymnasiumPufferEnv, one), (PettingZooPufferEnv, team)
for kind, creator in kinds:
    make = partial(kind, env_creator=creator)
    envs = pufferlib.vector.make(make, num_envs=4)
    observations, infos = envs.reset(seed=1)
    observations, rewards, *rest = envs.step(envs.action_space.sample())
    print(observations.shape)
