"""Learned policies: a network, its encoding, and a card that says where it comes from.

A policy file is one safetensors file of tensors and JSON, protected by a digest. Reading one never runs code.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from posse import ObservationLayout
from posse.declarations import unknown
from posse.numeric import BoolArray, FloatArray, OwnArrays
from posse.rules import SPLITS
from posse_baselines.ddcs import DDCS
from posse_baselines.files import write_atomically
from posse_baselines.learned.inputs import EncodedField, Encoder, Encoding
from posse_baselines.learned.network import Network, forward
from posse_baselines.policies.scripted import SCRIPTED
from posse_baselines.policy import Annotations, BasePolicy, Memory, Policy, PolicyError
from posse_baselines.safeguard import Guard

FORMAT: Final = 1
"""Version of the policy file's format."""
SIDES: Final = ("trackers", "target")
"""What a policy moves."""
MOTION: Final = 2
"""Numbers of an action that move the robot; an adviser's proposal adds as many inputs."""
_REACH: Final = np.float32(2.0)  # times the output, a correction spans all velocities from either end
_KEY: Final = "posse-policy"


class _Memory(NamedTuple):
    """What a learned policy remembers of its worlds."""

    encoder: Encoder
    minds: Any
    """Of the adviser, or the :class:`~posse_baselines.safeguard.Guard`; ``None``: of neither."""

    def restart(self, mask: BoolArray) -> None:
        """Restart encoder, adviser and safeguard in the worlds of a mask (E,)."""
        self.encoder.restart(mask)
        if self.minds is not None:
            self.minds.restart(mask)

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return what encoder, adviser and safeguard remember as arrays by name; views, not copies."""
        return {**self.encoder.arrays(), **({} if self.minds is None else self.minds.arrays())}


class LearnedPolicy(OwnArrays, BasePolicy):
    """A learned policy, played from plain numbers.

    Args:
        network: Computes the actions.
        encoding: The network's inputs.
        card: Describes the policy: ``name``, ``side``, ``trained_splits``, ``message_size``, and anything else.
        adviser: Team of the DDCS whose wanted velocity the network corrects, if any (residual policy learning: Silver
            et al. 2018, Johannink et al. 2019). The network reads the velocity as well, and twice its output is added
            to it, before the adviser's safeguard (Alshiekh et al. 2018): zeros give the adviser, and every velocity
            stays reachable. The adviser sends its own messages.
        safeguard: Whether its actions are wanted velocities, which the safeguard carries out
            (:mod:`posse_baselines.safeguard`).

    Attributes:
        trained_splits: Splits whose worlds it was trained on; evaluations refuse them.
        side: What it moves, ``"trackers"`` or ``"target"``.

    Raises:
        PolicyError: Network and encoding do not fit each other, or an invalid card.
    """

    def __init__(
        self,
        network: Network,
        encoding: Encoding,
        card: Mapping[str, Any],
        adviser: Policy | None = None,
        safeguard: bool = False,
    ) -> None:
        if adviser is not None:
            named = SCRIPTED[adviser.name]() if adviser.name in SCRIPTED else None
            if not (isinstance(adviser, DDCS) and isinstance(named, DDCS) and adviser.settings == named.settings):
                raise PolicyError(
                    f"{adviser.name!r} cannot be an adviser: use a policy of the DDCS by its name, such as ddcs-tuned; "
                    "the file of what is trained holds the name alone"
                )
        size = encoding.size + (0 if adviser is None else MOTION)
        most = MOTION if adviser is not None else network.outputs  # an adviser sends its own messages
        if network.inputs != size or not MOTION <= network.outputs <= most:
            raise PolicyError(
                f"the network takes {network.inputs} numbers and gives {network.outputs}; encoding and adviser give "
                f"{size} and take {MOTION}{' or more' if adviser is None else ''}"
            )
        self.network = network
        self.encoding = encoding
        self.adviser = adviser
        said = card.get("message_size", 0) if adviser is None else adviser.message_size
        if type(said) is not int or said < 0:
            raise PolicyError(f"message_size={said!r:.80} on its card must be a whole number of at least 0")
        self.message_size = max(network.outputs - MOTION, encoding.message_size, said)
        self.safeguard = safeguard
        self._layers = network.layers()
        name, side = card.get("name", "learned"), card.get("side", "trackers")
        splits = card.get("trained_splits", ("train",))
        if side not in SIDES:
            raise PolicyError(f"side={side!r:.80} on its card must be {' or '.join(SIDES)}")
        if not isinstance(splits, (list, tuple)) or any(split not in SPLITS for split in splits):
            raise PolicyError(f"trained_splits={splits!r:.80} on its card must be a list of {', '.join(SPLITS)}")
        self.name, self.side, self.trained_splits, self.card = name, side, tuple(splits), dict(card)

    def with_card(self, card: Mapping[str, Any]) -> "LearnedPolicy":
        """Return the same policy with another card."""
        return LearnedPolicy(self.network, self.encoding, card, self.adviser, self.safeguard)

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory of ``num_worlds`` worlds; PolicyError if the layout lacks a field that is read."""
        super().begin(layout, num_worlds)
        minds = Guard(layout, num_worlds) if self.safeguard else None
        if self.adviser is not None:  # it has a safeguard of its own
            minds = self.adviser.begin(layout, num_worlds)
        robots = 1 if self.side == "target" else layout.scenario.num_trackers
        return _Memory(Encoder(self.encoding, layout, num_worlds, robots), minds)

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the most likely actions (E, N, 2 + m) for observations (E, N, F).

        One that moves the target takes (E, 1, F).
        """
        m: _Memory = memory
        inputs = m.encoder.encode(observations, m.minds)
        if self.adviser is not None:
            proposals, _ = self.adviser.propose(observations, m.minds)
            inputs = np.concatenate([inputs, proposals.reshape(len(inputs), MOTION)], axis=1)
        outputs = self._forward(inputs).reshape(*m.encoder.estimates.shape, -1)
        if self.adviser is not None:
            return self.adviser.carry_out(observations, m.minds, _REACH * outputs)[0], m
        actions = np.zeros((*outputs.shape[:2], MOTION + m.encoder.layout.scenario.message_size), np.float32)
        actions[..., : outputs.shape[2]] = outputs
        return m.minds.actions(observations, actions) if self.safeguard else actions, m

    def _forward(self, inputs: FloatArray) -> FloatArray:
        """Return the outputs of the network (E N, 2 + m) for its inputs."""
        return forward(self._layers, inputs)

    def annotations(self, memory: Memory) -> Annotations:
        """Return the adviser's annotations."""
        return {} if self.adviser is None else self.adviser.annotations(memory.minds)

    def description(self) -> dict[str, Any]:
        """Return what its file says beside the tensors, as plain values."""
        return {
            "format": FORMAT,
            **{name: getattr(self.network, name) for name in ("activation", "output")},
            "encoding": asdict(self.encoding),
            "card": self.card,
            "adviser": None if self.adviser is None else self.adviser.name,
            "safeguard": self.safeguard,
        }

    def save(self, path: Path) -> None:
        """Write the policy and its card as one file, which replaces an old one only as a whole."""
        path.parent.mkdir(parents=True, exist_ok=True)
        write_policy_file(path, self.network.tensors(), self.description())

    @classmethod
    def from_file(cls, path: str | Path) -> "LearnedPolicy":
        """Return the policy of a file; PolicyError if there is none, or it is damaged or of another kind."""
        path = Path(path)
        tensors, text = _read(path)
        try:
            description = json.loads(text)
            if description["format"] != FORMAT:
                raise PolicyError(
                    f"its format is {description['format']!r:.80}, this version reads {FORMAT}: "
                    "install the version that wrote it"
                )
            count = sum(name.endswith(".weight") for name in tensors)
            network = Network(
                mean=tensors["normaliser.mean"],
                scale=tensors["normaliser.scale"],
                weights=tuple(tensors[f"layers.{k}.weight"] for k in range(count)),
                biases=tuple(tensors[f"layers.{k}.bias"] for k in range(count)),
                activation=description["activation"],
                output=description["output"],
            )
            adviser = description["adviser"]  # a scripted policy of this package: a file never names other code
            if adviser is not None and adviser not in SCRIPTED:
                raise PolicyError(f"{unknown('adviser', adviser, SCRIPTED)}: install the version that wrote it")
            read = description["encoding"]
            fields = tuple(EncodedField(*field) for field in read["fields"])
            return cls(
                network,
                Encoding(read["kind"], read["neighbours"], fields),
                description["card"],
                None if adviser is None else SCRIPTED[adviser](),
                description["safeguard"],
            )
        except PolicyError as error:
            raise PolicyError(f"{path}: {error}") from error
        except (LookupError, TypeError, ValueError, OverflowError, AttributeError) as error:
            raise PolicyError(f"{path} is damaged: {error!r:.200}") from error


def write_policy_file(path: Path, tensors: Mapping[str, FloatArray], description: Any) -> None:
    """Write a policy file; its description is any JSON."""
    text = json.dumps(description, sort_keys=True)
    write_atomically(path, save(dict(tensors), {_KEY: text, "digest": _digest(tensors, text)}))


def _read(path: Path) -> tuple[dict[str, FloatArray], str]:
    """Return the tensors and the description of a policy file."""
    try:
        with safe_open(path, framework="numpy") as file:
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            metadata = file.metadata() or {}
    except FileNotFoundError:
        raise PolicyError(f"there is no policy file {path}") from None
    except (SafetensorError, OSError, TypeError, ValueError) as error:
        raise PolicyError(f"{path} is damaged, truncated, or not a policy file: {error!s:.200}") from error
    text = metadata.get(_KEY, "")
    if metadata.get("digest") != _digest(tensors, text):
        raise PolicyError(f"{path} holds no policy of posse, or a damaged one: its digest does not match its contents")
    return tensors, text


def _digest(tensors: Mapping[str, FloatArray], text: str) -> str:
    """Return a hash over all that a file says."""
    digest = hashlib.sha256(text.encode())
    for name in sorted(tensors):
        digest.update(f"{name} {tensors[name].dtype} {tensors[name].shape}".encode())
        digest.update(np.ascontiguousarray(tensors[name]).tobytes())
    return digest.hexdigest()
