"""``posse export``: the network of a learned policy as ONNX, for robots without Python; needs the extra ``export``."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import tyro

from posse_baselines.files import write_atomically
from posse_baselines.learned import LearnedPolicy
from posse_baselines.learned.network import LIMIT
from posse_baselines.learned.policy import MOTION
from posse_baselines.registry import SHIPPED_TARGETS, shipped
from posse_training.errors import SettingsError, require
from posse_training.replay.format import to_json

_OPSET: Final = 13
_IR_VERSION: Final = 8
"""With the opset, what runtimes since 2021 can read; the graph needs nothing newer."""


def export(policy: LearnedPolicy, out: str | Path) -> None:
    """Write the network of a learned policy, with its normalisation, as an ONNX file.

    Inputs and outputs are float32, a row for each robot; :func:`columns` names them. The metadata has ``columns`` and
    ``policy``, which is what a policy file says beside its tensors, both as JSON.

    Args:
        policy: The policy.
        out: File to write, which replaces an old one; ends in ``.onnx``.

    Raises:
        MissingExtraError: ``onnx`` is not installed.
        SettingsError: Another suffix.
    """
    path = Path(out)
    if path.suffix != ".onnx":
        raise SettingsError(f"out={str(path)!r} must end in .onnx")
    require("export", "onnx")
    from onnx import TensorProto, checker, helper, numpy_helper

    network, named, nodes = policy.network, columns(policy), []
    tensor = helper.make_tensor_value_info
    *inputs, output = [tensor(name, TensorProto.FLOAT, ["robots", len(names)]) for name, names in named.items()]
    bounds = {"lower": -LIMIT, "upper": LIMIT, "minus_one": -1.0, "one": 1.0}
    constants = network.tensors() | {name: np.array(value, np.float32) for name, value in bounds.items()}

    def add(operator: str, *of: str, to: str, **attributes: int) -> str:
        nodes.append(helper.make_node(operator, of, [to], **attributes))
        return to

    x = add("Concat", *(each.name for each in inputs), to="inputs", axis=1)
    x = add("Sub", x, "normaliser.mean", to="centred")
    x = add("Mul", x, "normaliser.scale", to="scaled")
    x = add("Clip", x, "lower", "upper", to="normalised")
    for k in range(len(network.weights)):
        if k:
            x = add(network.activation.capitalize(), x, to=f"layers.{k - 1}.active")
        x = add("Gemm", x, f"layers.{k}.weight", f"layers.{k}.bias", to=f"layers.{k}", transB=1)
    if network.output == "tanh":
        x = add("Tanh", x, to="squashed")
    add("Clip", x, "minus_one", "one", to=output.name)
    initial = [numpy_helper.from_array(array, name) for name, array in constants.items()]
    graph = helper.make_graph(nodes, "posse", inputs, [output], initial)
    opset = [helper.make_opsetid("", _OPSET)]
    model = helper.make_model(graph, opset_imports=opset, ir_version=_IR_VERSION, producer_name="posse")
    helper.set_model_props(model, {"columns": json.dumps(named), "policy": json.dumps(to_json(policy.description()))})
    checker.check_model(model)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, model.SerializeToString())


def columns(policy: LearnedPolicy) -> dict[str, list[str]]:
    """Return the names of the columns of each input, in order, and of the output, which is the last.

    Inputs are ``features``, ``observation`` and an adviser's ``proposal``, where the policy reads them. The output is
    the ``action``, the ``wanted_velocity`` that the safeguard carries out, or the ``correction`` of a proposal.
    """
    encoding, network = policy.encoding, policy.network
    motion = ["ahead", "left"] if policy.adviser or policy.safeguard else ["speed", "turn_rate"]
    output = "correction" if policy.adviser else "wanted_velocity" if policy.safeguard else "action"
    every = {
        "features": [f"features[{k}]" for k in range(encoding.num_features)],
        "observation": encoding.names(),
        "proposal": motion if policy.adviser else [],
        output: motion + [f"message[{k}]" for k in range(network.outputs - MOTION)],
    }
    return {name: names for name, names in every.items() if names}


@dataclass(frozen=True)
class _Export:
    """Write the network of a learned policy, with its normalisation, as ONNX."""

    policy: Annotated[str, tyro.conf.Positional]
    """A learned team or target: its name, or a policy file."""
    out: Path
    """File to write; ends in .onnx."""


def main(arguments: Sequence[str]) -> None:
    """Export the policy that the arguments name, and print what the network reads and gives."""
    which = tyro.cli(_Export, prog="posse export", args=arguments)
    known = shipped() | shipped(SHIPPED_TARGETS)
    path = known.get(which.policy, Path(which.policy))
    if path.suffix != ".safetensors":
        raise SettingsError(f"{which.policy!r} has no network: give {', '.join(known)}, or a file, .safetensors")
    policy = LearnedPolicy.from_file(path)
    export(policy, which.out)
    *inputs, output = [f"{name} ({len(names)})" for name, names in columns(policy).items()]
    print(f"{which.out}: {', '.join(inputs)} -> {output}")
