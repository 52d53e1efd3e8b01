"""The command that repeats a training run."""

from __future__ import annotations

import shlex

from posse_training.runs.defaults import default_settings
from posse_training.runs.settings import TrainSettings


def command_of(settings: TrainSettings) -> str:
    """Return the command that trains with these settings, in the default folder.

    It also states the values of the scenario's own defaults: these are often recorded only after
    the training that found them, so the commit of the training may lack them.
    """
    which, side = (settings.scenario, settings.algorithm), settings.side
    default = default_settings(*which, side=side).to_dict()
    of_all = default_settings(*which, own=False, side=side).to_dict()
    stated = {"scenario", "algorithm", "steps", "seed"}
    if side == "target":
        stated |= {"side", "against"}
    words = ["posse", "train"]
    for name, value in settings.to_dict().items():
        usual = value == default[name] == of_all[name]
        if name == "folder" or (usual and name not in stated):
            continue
        option = name.replace("_", "-")
        if isinstance(value, bool):
            words.append(f"--{option}" if value else f"--no-{option}")
        elif isinstance(value, dict) and default[name]:
            words += [w for k, v in value.items() for w in (f"--{option}.{k}", str(v))]
        elif isinstance(value, dict):
            words += [f"--{option}", *(str(part) for item in value.items() for part in item)]
        elif isinstance(value, (tuple, list)):
            words += [f"--{option}", *map(str, value)]
        else:
            words += [f"--{option}", str(value)]
    return shlex.join(words)
