"""``--algorithm cmaes``: a linear correction of a script, found by CMA-ES over whole episodes.

Where a script is near its best, the noise that exploration adds to each action hides what a correction gains. Here a
candidate keeps its weights for whole episodes, all candidates of a generation play the same worlds, and what counts is
the safe score itself. Reference: Hansen, The CMA Evolution Strategy, 2016.

A mirror image of a world is a world. The output ahead therefore reads only inputs that a mirror leaves as they are,
and the output to the left only those that it turns round.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.scenarios.family import blocks
from posse_baselines.ddcs.belief import BELIEF, BELIEF_SIZE
from posse_baselines.files import read_json, write_json
from posse_baselines.learned import Encoding, LearnedPolicy, Network
from posse_baselines.learned.features import FEATURES
from posse_baselines.safeguard import MOTION
from posse_training.errors import require
from posse_training.evaluation.episodes import Match, play_shard
from posse_training.files import intact
from posse_training.train.checkpoint import write_curve
from posse_training.train.display import Display
from posse_training.train.export import make_card
from posse_training.train.settings import BEST, CURVE, LAST, Point, TrainSettings
from posse_training.train.validation import validate
from posse_training.train.worlds import adviser_of, pairings
from posse_training.tune import advance

STATE: Final = "state.json"
_LIMIT: Final = 10.0  # of an input; all are bounded by less
_TURNS: Final = ("turn_rate", "law_turn", "frame_rate")
"""Inputs whose sign a mirror changes, beside the second number of every vector."""
_PERMUTED: Final = ("looks",)
"""Inputs that a mirror exchanges; they are not read."""


def evolve(settings: TrainSettings, folder: Path, display: Display, num_threads: int | None = None) -> Path:
    """Search the weights of a correction, or resume that; return the file of the best mean on validation worlds.

    The run folder holds the scores of all candidates: the search follows from its seed and these.
    """
    require("training", "cmaes")
    from cmaes import CMA

    s, encoding = settings, Encoding(settings.encoding, 0, ())
    places = np.array(list(_places(encoding)))
    scores: list[list[float]] = []
    curve: list[Point] = []
    seconds = 0.0
    if (folder / STATE).is_file():
        with intact(folder / STATE):
            scores, curve, seconds = read_json(folder / STATE)
        display.note(f"resuming {folder} at generation {len(scores)}")
    started = time.monotonic() - seconds

    def policy(point: npt.NDArray[np.float64], card: dict[str, Any]) -> LearnedPolicy:
        """Return the correction of these weights."""
        size = encoding.size + MOTION + BELIEF_SIZE * encoding.believes
        weights = np.zeros((MOTION, size), np.float32)
        weights[places[:, 0], places[:, 1]] = point
        zeros, ones = np.zeros(size, np.float32), np.ones(size, np.float32)
        network = Network(zeros, ones, _LIMIT, (weights,), (zeros[:MOTION],), s.activation, "clip")
        return LearnedPolicy(network, encoding, card, adviser_of(s))

    def play(points: list[npt.NDArray[np.float64]]) -> list[float]:
        """Return the mean safe score of each candidate on the worlds of the present generation."""
        first = len(scores) * s.num_worlds
        shard = range(first, first + s.num_worlds)
        found = []
        for team in (policy(point, {}) for point in points):
            matches = [Match(team, pair.opponent, pair.scenario, s.seed, "train") for pair in pairings(s)]
            played = [play_shard(match, shard, num_threads=num_threads)["safe_score"] for match in matches]
            found.append(float(np.mean(played)))
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

    cma = CMA(mean=np.zeros(len(places)), sigma=s.deviation, seed=s.seed, population_size=s.population)
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
        write_json(folder / STATE, [scores, curve, time.monotonic() - started], indent=None)
    policy(cma.mean, make_card(s, steps=generations * each, curve=curve)).save(folder / LAST)
    return folder / BEST


def _places(encoding: Encoding) -> Iterator[tuple[int, int]]:
    """Yield the output and the input of each weight: features, what the script wants, and what it believes."""
    if encoding.with_features:
        yield from _mirrored(FEATURES, 0)
    yield from ((k, encoding.size + k) for k in range(MOTION))
    if encoding.believes:
        yield from _mirrored(BELIEF, encoding.size + MOTION)


def _mirrored(record: np.dtype[Any], start: int) -> Iterator[tuple[int, int]]:
    """Yield the output and the input of each weight on a record of floats and vectors."""
    for name in record.names or ():
        field = record[name]
        at = start + record.fields[name][1] // 4  # type: ignore[index]
        for k in range(prod(field.shape)):
            if name in _PERMUTED:
                continue
            if field.base == np.complex64:
                yield from ((0, at + 2 * k), (1, at + 2 * k + 1))
            else:
                yield int(name in _TURNS), at + k


def _steps_of(s: TrainSettings) -> int:
    """Return the steps that a candidate is played for."""
    parts = [blocks(pair.scenario, range(s.num_worlds), seed=s.seed, split="train") for pair in pairings(s)]
    return sum(len(worlds) * one.horizon * one.num_trackers for part in parts for one, worlds in part)
