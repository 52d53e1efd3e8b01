"""Plays episodes and keeps, frame by frame, what a replay shows.

========================== ================= ======================================================
column                     shape of a row    what it holds
========================== ================= ======================================================
tracker_x, tracker_y       (N,) m            where each tracker is
tracker_heading            (N,) rad          its heading, without jumps of 2π
tracker_sees               (N,)              1: its own sensor has the target
tracker_slot               (N,)              the slot that it occupies; -1: none
tracker_onsets             (N,)              contacts that began in this step
tracker_broken             (N,)              1: it is broken
tracker_sensor_dead        (N,)              1: its target sensor is in an outage
tracker_radio_dead         (N,)              1: its radio is in an outage
tracker_fix_step           (N,)              when its best fix of the target was taken; -1: none
tracker_fix_x, _y          (N,) m            where that fix is
tracker_fix_heading        (N,) rad          the target's heading in it
heard_step                 (N, N)            when what i last heard of j was sent; -1: never. Left
                                             out where the radio is perfect
target_x, _y, _heading     () m, rad         the target
target_frame               () rad            heading of the slot frame, ψ
target_dart                ()                1: a smart target darts
score                      ()                the present step's score
action                     (rows, 2)         what was chosen, in [-1, 1]: speed, turn rate
message                    (rows, m)         what was added to the broadcast
reward/NAME                (rows,)           each term that the scenario weighs, unweighted
belief/NAME                (N, ...)          what the policy tells of itself
observation/NAME           (rows, ...)       each field; only the sonar without ``observations``
========================== ================= ======================================================

Rows are trackers, and after them the target where it is an agent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import Batch, Scenario, get_scenario
from posse.numeric import BoolArray, FloatArray
from posse_baselines import Policy, PolicyError, begin, load
from posse_training.replay.episode import MOST_PLAYERS, Column, Player, Replay, join
from posse_training.replay.events import find_events
from posse_training.replay.world import describe_world
from posse_training.runs.settings import SettingsError

_PLACE: Final = 0.001  # m
_ANGLE: Final = 0.001  # rad
_FIX: Final = 0.01  # m, a measured place
_ACTION: Final = 0.004
_MESSAGE: Final = 1 / 512
_SCORE: Final = 0.0001
_COARSE: Final = 0.02  # what is only drawn
_LONGEST_ENTRY: Final = 400  # characters, of a card
_RESOLUTIONS: Final = {"m": 0.001, "m/s": 0.001, "rad": 0.001, "rad/s": 0.001, "s": 0.01}
_FINE: Final = 0.001
_STATES: Final = (
    "tracker_x", "tracker_y", "tracker_heading_cos", "tracker_heading_sin", "tracker_sees",
    "tracker_slot", "tracker_onsets", "tracker_broken_at", "tracker_sensor_dead_from",
    "tracker_radio_dead_from", "tracker_fix_step", "tracker_fix_x", "tracker_fix_y",
    "tracker_fix_cos", "tracker_fix_sin", "heard_step",
    "world_step", "world_x", "world_y", "world_heading_cos", "world_heading_sin",
    "world_frame_cos", "world_frame_sin", "world_pressed", "world_score", "world_detected_at",
    "world_settled_at", "world_recovered_at",
    "world_contacts_tracker", "world_contacts_obstacle", "world_contacts_target",
)  # fmt: skip

_States = dict[str, npt.NDArray[Any]]


class Recorder:
    """A batch that remembers what happens in one of its worlds, for a replay.

    Use it in the place of the batch, one episode at a time::

        recorder = Recorder(batch, "mine")
        observations = recorder.reset()
        while not recorder.over:
            actions = ...
            observations, rewards, terminated, truncated, infos = recorder.step(actions)
        write_replay(recorder.replay(), "mine.html")

    Args:
        batch: The worlds.
        name: What the page calls the player.
        world: Which world of the batch is recorded.
        observations: Whether to keep what every robot observed.
        about: What is known of the policy; plain JSON.

    Raises:
        SettingsError: No such world in the batch, or a batch whose worlds begin anew in the step
            that ends them: their last states are lost.
    """

    def __init__(
        self,
        batch: Batch,
        name: str,
        *,
        world: int = 0,
        observations: bool = True,
        about: Mapping[str, Any] | None = None,
    ) -> None:
        if not 0 <= world < batch.num_worlds:
            raise SettingsError(
                f"world={world} is not in the batch: it holds worlds 0 to {batch.num_worlds - 1}"
            )
        if batch.autoreset == "same_step":
            raise SettingsError(
                "a batch with autoreset='same_step' loses its last states and cannot be recorded: "
                "make it with autoreset='disabled'"
            )
        self.batch = batch
        self.name = name
        self._world = world
        self._whole = observations
        self._about = dict(about or {})
        self._clear()

    def _clear(self) -> None:
        self._states: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in _STATES}
        self._observations: list[FloatArray] = []
        self._actions: list[FloatArray] = []
        self._terms: dict[str, list[npt.NDArray[Any]]] = {}
        self._beliefs: dict[str, list[npt.NDArray[Any]]] = {}
        self._described: dict[str, Any] = {}
        self._metrics: dict[str, float] = {}

    @property
    def over(self) -> bool:
        """Whether the recorded episode has ended."""
        return bool(self.batch.terminated[self._world] or self.batch.truncated[self._world])

    def reset(self, **arguments: Any) -> FloatArray:
        """Start an episode (see :meth:`posse.Batch.reset`) and record from here."""
        observations = self.batch.reset(**arguments)
        self._clear()
        self._described = describe_world(self.batch, self._world, self._whole)
        self._note(observations)
        return observations

    def step(
        self, actions: npt.ArrayLike, beliefs: Mapping[str, npt.ArrayLike] | None = None
    ) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Advance the batch (see :meth:`posse.Batch.step`) and record the step.

        Args:
            actions: (E, rows, 2 + message_size) in [-1, 1].
            beliefs: What the policy had in mind when it chose them, (E, N, ...) each:
                ``policy.annotations(memory)``.

        Raises:
            SettingsError: Before :meth:`reset`, or after the end of the recorded episode.
        """
        if not self._observations:
            raise SettingsError("nothing is recorded before reset: call the recorder's reset()")
        if self.over:
            raise SettingsError("the recorded episode has ended: call the recorder's reset()")
        told = {name: np.array(value)[self._world] for name, value in (beliefs or {}).items()}
        done = self.batch.step(actions)
        observations, *_, infos = done
        self._actions.append(np.array(actions, np.float32)[self._world])
        for name in self._described["weights"]:
            self._terms.setdefault(name, []).append(infos["reward_terms"][name][self._world])
        for name, value in told.items():
            self._beliefs.setdefault(name, []).append(value)
        self._note(observations)
        return done

    def _note(self, observations: FloatArray) -> None:
        state = self.batch.state
        for name, column in self._states.items():
            column.append(state[name][self._world].copy())
        self._observations.append(observations[self._world].copy())
        self._metrics = {
            name: float(value[self._world]) for name, value in self.batch.metrics().items()
        }

    def player(self) -> Player:
        """Return what has been played so far.

        Raises:
            SettingsError: Nothing has.
        """
        if not self._observations:
            raise SettingsError("nothing is recorded before reset: call the recorder's reset()")
        states = {name: np.stack(column) for name, column in self._states.items()}
        beliefs = {name: _last_kept(column) for name, column in self._beliefs.items()}
        scenario = self.batch.scenario
        columns = {
            **_state_columns(states, scenario),
            **self._action_columns(),
            **{
                f"reward/{name}": _number_column(
                    np.stack([np.zeros_like(column[0]), *column]), _FINE
                )
                for name, column in self._terms.items()
            },
            **{f"belief/{name}": _number_column(value, _COARSE) for name, value in beliefs.items()},
            **self._observation_columns(),
        }
        events = find_events(states, scenario.control_step, beliefs.get("leader"))
        return Player(self.name, columns, events, dict(self._metrics), self._about)

    def replay(self) -> Replay:
        """Return what has been played so far as a replay of its own."""
        player = self.player()
        return Replay(self._described, (player,))

    def _action_columns(self) -> dict[str, Column]:
        if not self._actions:
            return {}
        actions = _last_kept(self._actions)
        columns = {"action": Column(actions[..., :2], _ACTION)}
        if actions.shape[-1] > 2:
            columns["message"] = Column(actions[..., 2:], _MESSAGE)
        return columns

    def _observation_columns(self) -> dict[str, Column]:
        layout = self.batch.layout
        views = layout.views(np.stack(self._observations))
        columns = {}
        for field in layout.fields:
            if not self._whole and field.name != "sonar":
                continue
            finest = _RESOLUTIONS.get(field.unit, _FINE) if self._whole else _COARSE
            if field.name == "neighbour_message":
                finest = _MESSAGE
            column = _number_column(views[field.name], finest)
            columns[f"observation/{field.name}"] = Column(
                column.values, column.resolution, field.unit
            )
        return columns


def _last_kept(rows: Sequence[npt.NDArray[Any]]) -> npt.NDArray[Any]:
    """Return T rows as T + 1: nothing is chosen in the last frame, which keeps what was."""
    return np.stack([*rows, rows[-1]])


def _number_column(values: npt.NDArray[Any], resolution: float) -> Column:
    """Return a column that is kept exactly where it holds whole numbers."""
    finite = np.isfinite(values)
    whole = np.array_equal(values[finite], np.rint(values[finite]))
    return Column(values, 1.0 if whole else resolution)


def _angle(states: _States, cosine: str, sine: str) -> Column:
    return Column(np.unwrap(np.arctan2(states[sine], states[cosine]), axis=0), _ANGLE, "rad")


def _state_columns(states: _States, scenario: Scenario) -> dict[str, Column]:
    step = states["world_step"][:, None]
    outage = max(1, round(scenario.outage_time / scenario.control_step))

    def in_outage(name: str) -> Column:
        since = step.astype(np.int64) - states[name]
        return Column(((since >= 0) & (since < outage)).astype(np.int8))

    columns = {
        "tracker_x": Column(states["tracker_x"], _PLACE, "m"),
        "tracker_y": Column(states["tracker_y"], _PLACE, "m"),
        "tracker_heading": _angle(states, "tracker_heading_cos", "tracker_heading_sin"),
        "tracker_sees": Column(states["tracker_sees"]),
        "tracker_slot": Column(states["tracker_slot"]),
        "tracker_onsets": Column(states["tracker_onsets"]),
        "tracker_broken": Column((states["tracker_broken_at"] <= step).astype(np.int8)),
        "tracker_sensor_dead": in_outage("tracker_sensor_dead_from"),
        "tracker_radio_dead": in_outage("tracker_radio_dead_from"),
        "tracker_fix_step": Column(states["tracker_fix_step"]),
        "tracker_fix_x": Column(states["tracker_fix_x"], _FIX, "m"),
        "tracker_fix_y": Column(states["tracker_fix_y"], _FIX, "m"),
        "tracker_fix_heading": _angle(states, "tracker_fix_cos", "tracker_fix_sin"),
        "target_x": Column(states["world_x"], _PLACE, "m"),
        "target_y": Column(states["world_y"], _PLACE, "m"),
        "target_heading": _angle(states, "world_heading_cos", "world_heading_sin"),
        "target_frame": _angle(states, "world_frame_cos", "world_frame_sin"),
        "target_dart": Column((states["world_pressed"] < 0).astype(np.int8)),
        "score": Column(states["world_score"], _SCORE),
    }
    if states["heard_step"].size:
        columns["heard_step"] = Column(states["heard_step"])
    return columns


def record(
    policies: Sequence[str | Policy | tuple[str, Policy]],
    scenario: str | Scenario = "smart",
    *,
    seed: int = 7,
    world: int = 0,
    split: str = "test",
    seconds: float | None = None,
    observations: bool = True,
    **overrides: Any,
) -> Replay:
    """Play one world with each policy.

    Args:
        policies: One to four: names (see :func:`posse_baselines.load`), policies, or pairs
            (label, policy).
        scenario: By name or as a value; its messages are made as long as each policy needs.
        seed: Of the world.
        world: Its index.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        seconds: Play so long at most, s; ``None``: to the end.
        observations: Whether to keep what every tracker observed: most of a page's size.
        **overrides: Settings of the scenario.

    Raises:
        SettingsError: No policy, more than four, ``seconds`` not above 0.
        PolicyError: A policy that does not fit the scenario, or a target that is an agent.
        ScenarioError: An unknown scenario or split, an impossible setting, seed or world.
    """
    settings = get_scenario(scenario, **overrides)
    if not 1 <= len(policies) <= MOST_PLAYERS:
        raise SettingsError(
            f"a replay shows 1 to {MOST_PLAYERS} players, got {len(policies)} policies"
        )
    if seconds is not None and not seconds > 0:
        raise SettingsError(f"seconds={seconds!r} must be above 0")
    if settings.num_agents != settings.num_trackers:
        raise PolicyError(
            f"the target of {settings.name!r} is an agent, and a policy drives trackers only: "
            "record the episode with posse_training.replay.Recorder"
        )
    steps = settings.horizon if seconds is None else round(seconds / settings.control_step)
    replays = []
    for given in policies:
        label, policy = given if isinstance(given, tuple) else (None, given)
        if isinstance(policy, str):
            policy = load(policy)
        longest = max(settings.message_size, policy.message_size)
        batch = Batch(
            settings.replace(message_size=longest), 1,
            seed=seed, split=split, first_world=world, autoreset="disabled",
        )  # fmt: skip
        recorder = Recorder(
            batch, label or policy.name, observations=observations, about=_about(policy)
        )
        memory, seen = begin(policy, batch), recorder.reset()
        for _ in range(max(1, steps)):
            actions, memory = policy.act(seen, memory)
            seen, *_ = recorder.step(actions, policy.annotations(memory))
            if recorder.over:
                break
        replays.append(recorder.replay())
    return join(replays)


def _about(policy: Policy) -> dict[str, Any]:
    """Return what is known of a policy: of a learned one's card, what fits a line each."""
    about: dict[str, Any] = {"reads_state": True} if policy.reads_state else {}
    card = getattr(policy, "card", None)
    for name, value in card.items() if isinstance(card, Mapping) else ():
        text = ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
        if not isinstance(value, Mapping) and len(text) <= _LONGEST_ENTRY:
            about[str(name)] = value if isinstance(value, (int, float)) else text
    return about
