import numpy as np

from posse import ObservationLayout, get_scenario
from posse_baselines import from_function

layout = ObservationLayout(get_scenario("constant"))


def chase(observations):
    views = layout.views(observations)  # turn towards the last fix of the target, at full speed
    return np.stack([np.ones_like(views["speed"]), views["target_bearing"][..., 1]], axis=-1)


policy = from_function(chase)  # posse compare own_function:policy ddcs-tuned --scenario constant
