from functools import partial

import gymnasium
import pufferlib.vector
from pufferlib.emulation import GymnasiumPufferEnv, PettingZooPufferEnv

import posse

settings = {
    "scenario": "smart",
    "horizon": 20,
    "discrete_actions": True,
}


def one():
    env = gymnasium.make("posse/Solo-v0", **settings)
    # PufferLib does not reset episodes that are truncated.
    return gymnasium.wrappers.Autoreset(env)


team = partial(posse.parallel_env, **settings)
kinds = (GymnasiumPufferEnv, one), (PettingZooPufferEnv, team)
for kind, creator in kinds:
    make = partial(kind, env_creator=creator)
    envs = pufferlib.vector.make(make, num_envs=4)
    observations, infos = envs.reset(seed=1)
    for _ in range(50):
        actions = envs.action_space.sample()
        observations, rewards, *rest = envs.step(actions)
    print(observations.shape)
