"""``--algorithm cmaes``: a linear correction of a script, found by CMA-ES over whole episodes.

Where a script is near its best, the noise that exploration adds to each action hides what a correction gains. Here a
candidate keeps its weights for whole episodes, all candidates of a generation play the same worlds, and what counts is
the safe score itself. Reference: Hansen, The CMA Evolution Strategy, 2016.

The mirror image of a world is a world. The output ahead therefore reads only inputs that keep their sign in a mirror,
and the output to the left only those that change it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
import numpy.typing as npt

from posse.scenarios.family import blocks
from posse_baselines.ddcs.belief import BELIEF
from posse_baselines.files import read_json, write_json
from posse_baselines.learned import Encoding, LearnedPolicy, Network
from posse_baselines.learned.features import FEATURES
from posse_baselines.safeguard import MOTION
from posse_training.errors import require
from posse_training.evaluation.episodes import Match, play_shard
from posse_training.files import hold_settings, intact
from posse_training.provenance import software
from posse_training.train.checkpoint import write_curve
from posse_training.train.display import Display
from posse_training.train.export import make_card
from posse_training.train.networks import LIMIT
from posse_training.train.settings import BEST, CURVE, LAST, TrainSettings
from posse_training.train.validation import validate
from posse_training.train.worlds import adviser_of, divided
from posse_training.tune import advance

SOFTWARE: Final = "software.json"
STATE: Final = "state.json"
_TURNS: Final = ("turn_rate", "law_turn", "frame_rate")
"""Inputs whose sign a mirror changes, beside the second number of every vector."""


def evolve(settings: TrainSettings, folder: Path, display: Display, num_threads: int | None = None) -> Path:
    """Search the weights of a correction, or resume that; return the file of the best mean on validation worlds.

    The run folder holds the scores of all candidates: the search follows from its seed and these.
    """
    require("training", "cmaes")
    from cmaes import CMA

    s, encoding = settings, Encoding(settings.encoding, 0, ())
    basis = _basis(encoding)
    hold_settings(folder / SOFTWARE, software("cmaes", "numpy"))  # others draw other candidates
    state: dict[str, Any] = {"scores": [], "curve": [], "seconds": 0.0}
    if (folder / STATE).is_file():
        with intact(folder / STATE):
            kept = read_json(folder / STATE)
            state = {name: kept[name] for name in state}
        display.note(f"resuming {folder} at generation {len(state['scores'])}")
    scores, curve, started = state["scores"], state["curve"], time.monotonic() - state["seconds"]

    def policy(point: npt.NDArray[np.float64], card: dict[str, Any]) -> LearnedPolicy:
        """Return the correction of these weights."""
        weights = np.tensordot(point.astype(np.float32), basis, 1)
        zeros, ones = np.zeros(weights.shape[1], np.float32), np.ones(weights.shape[1], np.float32)
        network = Network(zeros, ones, LIMIT, (weights,), (zeros[:MOTION],), s.activation, "clip")
        return LearnedPolicy(network, encoding, card, adviser_of(s))

    def play(points: list[npt.NDArray[np.float64]]) -> list[float]:
        """Return the mean safe score of each candidate on the worlds of the present generation."""
        first, parts = len(scores) * s.num_worlds, divided(s)
        found = []
        for team in (policy(point, {}) for point in points):
            played = []
            for pair, worlds in parts:
                match = Match(team, cast("Any", pair.opponent), pair.scenario, s.seed, "train")
                shard = range(first + worlds.start, first + worlds.stop)
                played.append(play_shard(match, shard, num_threads=num_threads)["safe_score"])
            found.append(float(np.mean(np.concatenate(played))))
        return found

    def evaluate(steps: int) -> None:
        """Score the mean of the search on the validation worlds; keep it if it is the best so far."""
        point = {"steps": float(steps), "seconds": time.monotonic() - started}
        point |= validate(s, policy(cma.mean, {}))
        best = max((earlier["safe_score"] for earlier in curve), default=-1.0)
        curve.append(point)
        write_curve(folder / CURVE, curve)
        if point["safe_score"] > best:
            policy(cma.mean, make_card(s, steps=steps, curve=curve)).save(folder / BEST)
        display.evaluated(point)

    cma = CMA(mean=np.zeros(len(basis)), sigma=s.deviation, seed=s.seed, population_size=s.population)
    each = s.population * _steps_of(s)  # of a generation
    generations = -(-s.steps // each)
    display.begin(len(scores) * each, generations * each)
    if not curve:
        evaluate(0)
    for generation in range(generations):
        resumed = generation < len(scores)
        advance(cma, scores, generation, play)
        if resumed:
            continue
        steps = (generation + 1) * each
        display.progress(steps, float(np.mean(scores[-1])))
        if steps // s.evaluate_every > curve[-1]["steps"] // s.evaluate_every or generation + 1 == generations:
            evaluate(steps)
        state["seconds"] = time.monotonic() - started
        write_json(folder / STATE, state, indent=None)
    policy(cma.mean, make_card(s, steps=generations * each, curve=curve)).save(folder / LAST)
    return folder / BEST


def _basis(encoding: Encoding) -> npt.NDArray[np.float32]:
    """Return patterns (P, MOTION, inputs): their sum, weighted by a point's P numbers, is a network's weights."""
    images = list(_images(encoding))
    basis = []
    for column, (image, sign) in enumerate(images):
        for output in range(MOTION):
            weights = np.zeros((MOTION, len(images)), np.float32)
            weights[output, column] = 1.0
            weights[output, image] += -sign if output else sign
            if image >= column and weights.any():
                basis.append(weights / weights.max())
    return np.array(basis)


def _images(encoding: Encoding) -> Iterator[tuple[int, int]]:
    """Yield for each input the one that shows it in a mirror, and its sign there: features, proposal, belief."""
    if encoding.with_features:
        yield from _mirrored(FEATURES, 0)
    yield from ((encoding.size, 1), (encoding.size + 1, -1))
    if encoding.believes:
        yield from _mirrored(BELIEF, encoding.size + MOTION)


def _mirrored(record: np.dtype[Any], start: int) -> Iterator[tuple[int, int]]:
    """Yield the same for a record whose first number is input ``start``; ``looks`` are directions round the tracker."""
    at = start
    for name in record.names or ():
        field = record[name]
        size = field.itemsize // np.dtype(np.float32).itemsize
        for k in range(size):
            turns = k % 2 == 1 if field.base == np.complex64 else name in _TURNS
            yield at + (-k % size if name == "looks" else k), -1 if turns else 1
        at += size


def _steps_of(s: TrainSettings) -> int:
    """Return the steps that a candidate is played for."""
    parts = [blocks(pair.scenario, worlds, seed=s.seed, split="train") for pair, worlds in divided(s)]
    return sum(len(worlds) * one.horizon * one.num_trackers for part in parts for one, worlds in part)
