"""Networks of arbitrary weights, as policies."""

import itertools
from dataclasses import replace
from typing import Any

import numpy as np

import posse
from posse_baselines.learned import Encoding, LearnedPolicy, Network


def network_for(inputs: int, outputs: int = 2, seed: int = 0, **changes: Any) -> Network:
    """A network of arbitrary weights."""
    generator = np.random.default_rng(seed)
    sizes = (inputs, 24, 16, outputs)

    def draw(*shape: int) -> Any:
        return generator.normal(size=shape).astype(np.float32)

    network = Network(
        mean=draw(inputs),
        scale=np.abs(draw(inputs)),
        weights=tuple(draw(b, a) / np.float32(a**0.5) for a, b in itertools.pairwise(sizes)),
        biases=tuple(draw(b) for b in sizes[1:]),
        activation="tanh",
        output="clip",
    )
    return replace(network, **changes)


def policy_for(layout: posse.ObservationLayout, kind: str = "features", **changes: Any) -> LearnedPolicy:
    """A policy of arbitrary weights and the name "mine"."""
    encoding = Encoding.of(layout, kind)
    return LearnedPolicy(network_for(encoding.size, **changes), encoding, {"name": "mine"})


def observations_of(scenario: str, worlds: int = 6, steps: int = 5, **overrides: Any) -> Any:
    batch = posse.batch(scenario, worlds, seed=3, **overrides)
    observations = batch.reset()
    generator = np.random.default_rng(0)
    for _ in range(steps):
        observations, *_ = batch.step(generator.uniform(-1, 1, batch.action_shape))
    return batch, observations


def target_for(scenario: posse.Scenario) -> LearnedPolicy:
    """A policy of arbitrary weights that moves the target."""
    encoding = Encoding.of(posse.ObservationLayout(scenario.replace(message_size=0)), "plain")
    return LearnedPolicy(network_for(encoding.size), encoding, {"name": "evading", "side": "target"})
