"""``--algorithm cmaes``: a linear policy, or a linear correction of a script, found by sep-CMA-ES over whole episodes.

Noise that exploration adds to each action hides what a correction gains where a script is near its best, and does not
find what costs a robot its slot for seconds before the team gains. Here a candidate keeps its weights for whole
episodes, all candidates of a generation play the same worlds, and what counts is the team's safe score itself.
A covariance of the diagonal alone is learned in the few hundred generations that there are. References: Hansen, The CMA
Evolution Strategy, 2016; Ros and Hansen, A Simple Modification in CMA-ES, 2008.

The mirror image of a world is a world. The output ahead therefore reads only inputs that keep their sign in a mirror,
and the output to the left only those that change it.
"""

import time
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
import numpy.typing as npt

from posse.numeric import FloatArray
from posse.scenarios.family import blocks
from posse_baselines import batch_for, load, rollout
from posse_baselines.files import read_json, write_json
from posse_baselines.learned import Encoding, LearnedPolicy, Network
from posse_baselines.learned.features import FEATURES
from posse_baselines.learned.network import LIMIT
from posse_baselines.learned.policy import MOTION
from posse_training.errors import require
from posse_training.files import check_held, intact, write_csv
from posse_training.provenance import software
from posse_training.train.display import Display
from posse_training.train.export import make_card
from posse_training.train.settings import BEST, CURVE, LAST, TrainSettings
from posse_training.train.validation import validate
from posse_training.train.worlds import divided
from posse_training.tune import advance

SOFTWARE: Final = "software.json"
STATE: Final = "state.json"
_TURN: Final = "law_turn"
"""Feature whose sign a mirror changes, beside the second number of every vector."""


def evolve(settings: TrainSettings, folder: Path, display: Display, num_threads: int | None = None) -> Path:
    """Search the weights, or resume that; return the file of the best mean on validation worlds.

    The run folder holds the scores of all candidates: the search follows from its seed and these.
    """
    from cmaes import SepCMA

    s, basis = settings, _basis(settings)
    check_held(folder / SOFTWARE, versions := software("cmaes", "numpy"))
    write_json(folder / SOFTWARE, versions)  # others draw other candidates
    state: dict[str, Any] = {"scores": [], "curve": [], "seconds": 0.0}
    if (folder / STATE).is_file():
        with intact(folder / STATE):
            kept = read_json(folder / STATE)
            state = {name: kept[name] for name in state}
        display.note(f"resuming {folder} at generation {len(state['scores'])}")
    scores, curve, started = state["scores"], state["curve"], time.monotonic() - state["seconds"]

    def team(points: list[npt.NDArray[np.float64]]) -> Candidates:
        return Candidates(s, np.tensordot(np.array(points, np.float32), basis, 1))

    def play(points: list[npt.NDArray[np.float64]]) -> list[float]:
        """Return the mean safe score of each candidate on the worlds of the present generation."""
        return team(points).scores(len(scores) * s.num_worlds, num_threads)

    def evaluate(steps: int) -> None:
        """Score the mean of the search on the validation worlds; keep it if it is the best so far."""
        found = team([cma.mean])
        point = {"steps": float(steps), "seconds": time.monotonic() - started, **validate(s, found)}
        best = max((earlier["safe_score"] for earlier in curve), default=-1.0)
        curve.append(point)
        write_csv(folder / CURVE, curve)
        if point["safe_score"] > best:
            found.with_card(make_card(s, steps=steps, curve=curve)).save(folder / BEST)
        display.evaluated(point)

    cma = SepCMA(mean=np.zeros(len(basis)), sigma=s.deviation, seed=s.seed, population_size=s.population)
    each = s.population * _steps_of(s)  # of a generation
    generations = max(len(scores), -(-s.steps // each))
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
        if steps // s.evaluate_every > curve[-1]["steps"] // s.evaluate_every:
            evaluate(steps)
        state["seconds"] = time.monotonic() - started
        write_json(folder / STATE, state, indent=None)
    if curve[-1]["steps"] < generations * each:  # also where a run is ended by fewer steps
        evaluate(generations * each)
        write_json(folder / STATE, state, indent=None)
    team([cma.mean]).with_card(make_card(s, steps=generations * each, curve=curve)).save(folder / LAST)
    return folder / BEST


def check_adviser(settings: TrainSettings) -> None:
    """Raise PolicyError if the script that a run corrects cannot be an adviser, MissingExtraError without cmaes."""
    require("training", "cmaes")
    Candidates(settings, np.zeros_like(_basis(settings)[:1]))


class Candidates(LearnedPolicy):
    """C policies or corrections, each of which plays its share of the worlds: the first one the first E / C, and so on.

    Their weights are (C, MOTION, inputs); a file of this policy holds the first one.
    """

    def __init__(self, settings: TrainSettings, weights: FloatArray) -> None:
        self._settings, self._weights = settings, weights
        zeros, ones = np.zeros(weights.shape[2], np.float32), np.ones(weights.shape[2], np.float32)
        network = Network(zeros, ones, (weights[0],), (zeros[:MOTION],), settings.activation, "clip")
        encoding = Encoding(settings.encoding, 0, ())
        adviser = None if settings.advise is None else load(settings.advise)
        super().__init__(network, encoding, {}, adviser, settings.safeguard)

    def _forward(self, inputs: FloatArray) -> FloatArray:
        if len(self._weights) == 1:
            return super()._forward(inputs)
        shares = inputs.clip(-LIMIT, LIMIT).reshape(len(self._weights), -1, inputs.shape[1])
        return (shares @ self._weights.transpose(0, 2, 1)).clip(-1.0, 1.0).reshape(-1, MOTION)

    def scores(self, first: int, num_threads: int | None) -> list[float]:
        """Return the mean safe score of each candidate, all in the same ``num_worlds`` worlds from number ``first``."""
        s, count, played = self._settings, len(self._weights), []
        where: dict[str, Any] = {"seed": s.seed, "split": "train"}
        for pair, worlds in divided(s):
            shard = range(first + worlds.start, first + worlds.stop)
            for one, numbers in blocks(pair.scenario, shard, **where):
                target = cast("Any", pair.opponent)
                whole = one.replace(terminate_on_contact=False)  # as in evaluations: scores are of whole episodes
                batch = batch_for(self, whole, count * len(numbers), target, num_threads=num_threads, **where)
                batch.reset()
                batch.arrays.world["index"] = np.tile(numbers, count)
                batch.arrays.world["episode"] = -1  # the next one is the first
                played.append(rollout(batch, self).metrics["safe_score"].reshape(count, -1))
        return list(map(float, np.concatenate(played, axis=1).mean(axis=1)))


def _basis(settings: TrainSettings) -> npt.NDArray[np.float32]:
    """Return patterns (P, MOTION, inputs): their sum, weighted by a point's P numbers, is a network's weights.

    Each has one weight, of an input that a mirror changes as it does the output.
    """
    turns: list[bool] = []  # of each input, whether a mirror changes its sign
    for name in FEATURES.names or ():
        turns += (False, True) if FEATURES[name] == np.complex64 else (name == _TURN,)
    turns += (False, True) if settings.advise is not None else ()  # of the proposal
    basis = np.zeros((len(turns), MOTION, len(turns)), np.float32)
    for column, turn in enumerate(turns):
        basis[column, int(turn), column] = 1.0
    return basis


def _steps_of(s: TrainSettings) -> int:
    """Return the steps that a candidate is played for."""
    parts = [blocks(pair.scenario, worlds, seed=s.seed, split="train") for pair, worlds in divided(s)]
    return sum(len(worlds) * one.horizon * one.num_trackers for part in parts for one, worlds in part)
