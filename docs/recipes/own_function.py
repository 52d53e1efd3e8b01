import numpy as np

from posse import ObservationLayout, get_scenario
from posse_baselines import from_function

layout = ObservationLayout(get_scenario("constant"))


def chase(observations):
    """Turn towards the last fix of the target, at full speed."""
    views = layout.views(observations)
    turn = views["target_bearing"][..., 1]  # the sine
    return np.stack([np.ones_like(turn), turn], axis=-1)


# posse compare own_function:policy pursuit --scenario constant
policy = from_function(chase)
