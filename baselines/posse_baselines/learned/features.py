"""Features that follow from an observation: the own slot and the way to it, or to where to look for the target.

They contain nothing that the observations of an episode lack; a network could learn them, but would first have to
learn the geometry: ranges times directions, the slots from the formation and ψ, and the matching of
slots to trackers. Where fixes or headings are noisy, they are averaged over time. Where poses drift, those of
team-mates are converted to the own frame as the safeguard has measured it, or the script.

All vectors are relative to the tracker: x ahead, y to the left (:mod:`posse_baselines.laws.geometry`). A length d is
scaled to d / (d + scale), which resolves both centimetres near the slot and tens of metres far from it.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse.numeric import HALF, ONE, ZERO, FloatArray, Record, Records, compiled, record_type
from posse_baselines.ddcs.memory import pair
from posse_baselines.laws.geometry import angle_of, clip, dot, length, scaled
from posse_baselines.laws.steering import Work, assign, push_from, push_inwards, slot_velocity

_SMALL: Final = np.float32(1e-6)
_NEAR: Final = np.float32(0.3)  # m, the default tolerance
_FAR: Final = np.float32(3.0)  # m
_GAIN: Final[Any] = np.float32(0.8)  # 1/s, of the slot law
_TURN_GAIN: Final = np.float32(3.0)  # 1/s
_FRAME_SHARE: Final = np.float32(0.8)  # of a tracker's speed above the target's, which the outermost slot may have
_OLDEST: Final = np.float32(2.0)  # s; a position is extrapolated for this long at most
_SPREAD: Final[Any] = np.float32(2.0)  # m²; a team-mate d away pushes by this / d², the own heading pulls by 1
_JUMP: Final = np.float32(1.0)  # m; a fix farther than this from where it was expected replaces the estimate
_OUTSIDE: Final = np.float32(20.0)  # m; a slot in a wall counts as so much farther
_FIRST: Final = 1e3  # m; by so much the first slot counts as nearer where it is filled at any rate

MOST: Final = 16
"""Robots in a matching at most: the own one and the nearest ones that it knows of."""
_F, _C = np.float32, np.complex64
Places = npt.NDArray[np.complex64]

FEATURES: Final = record_type(
    ("speed", _F),  # share of the greatest
    ("slot_near", _C),  # the way to the own slot, or to where to look for the target / (d + 0.3 m)
    ("slot_far", _C),  # the same / (d + 3 m)
    ("slot_away", _F),  # its length / (d + 1 m)
    ("target", _C),  # the way to the target / (d + 1 m); 0 while it is unknown
    ("target_velocity", _C),  # m/s; 0 while it is unknown
    ("law_speed", _F),  # of the velocity that the slot law wants, as a share of the greatest
    ("law_direction", _C),
    ("law_turn", _F),  # turn rate towards it, share of the greatest
    ("known", _F),  # 1, or 0 while the target is unknown
)
"""The features of one observation, float32 numbers in this order."""
NUM_FEATURES: Final = FEATURES.itemsize // np.dtype(np.float32).itemsize

ESTIMATE: Final = record_type(("age", _F), ("place", _C), ("speed", _F), ("frame", _C))
"""What a tracker remembers of the target: the age of its fix, s, -1 while it is unknown; where it was, m; its speed,
m/s; the heading of the slot frame."""


class Known(NamedTuple):
    """What a tracker knows of its scenario."""

    at: Records
    """Offsets of an observation's fields, an array of one record."""
    slots: Places
    """(N,) in the slot frame, m."""
    half: complex
    """Half the width and half the height of the arena, m; infinite on the open plane."""
    first: bool
    """Whether of more slots than robots the first is filled at any rate."""
    share: np.float32
    """Of a new fix in the estimate of the target."""
    trust: np.float32
    """Share of a new heading in the estimate of the slot frame's."""
    slowest: np.float32
    """Greatest speed of the slowest tracker, m/s."""
    unit: Any
    """m; of what is known of team-mates."""
    patience: np.float32
    """s; a robot silent for longer is taken for broken."""


@compiled
def write_features(
    row: FloatArray, known: Known, mates: Records, estimate: Record, places: Places, work: Work, out: Record
) -> None:
    """Write the features of one observation (F,) to ``out``, a :data:`FEATURES` of zeros, and update the estimate.

    ``mates`` (``MATE`` of the DDCS by number, or none) convert poses. It works in ``places`` (MOST,) and ``work``.
    """
    f, slots = known.at[0], known.slots
    count, working = _gather_team(row, known, mates, places)
    top = row[f.max_speed]
    out.speed = row[f.speed] / top
    if row[f.target_known] <= 0.0:
        estimate.age = -ONE
        # As if the own slot were far away in the direction to explore in.
        way = _explore(row, known, places[1:count])
        out.slot_near, out.slot_far, out.slot_away = way, way, ONE
        out.law_speed, out.law_direction, out.law_turn = ONE, way, _turn_to(way, row, f)
        return
    theta, frame, rate = _watch_frame(row, known, estimate)
    ahead: Any = dot(pair(row, f.target_velocity), theta)  # robots move along their headings, which are less noisy
    velocity, target = _estimate(row, f, theta, max(ahead, ZERO), known.share, estimate)
    for s in range(len(slots)):
        place = target + slots[s] * frame
        more = _OUTSIDE if _is_outside(row, known, place) else ZERO
        if s == 0 and known.first and working < count:
            more -= _FIRST
        for j in range(working):
            work.cost[j, s] = length(places[j] - place) + more
    assign(work.cost[:working], work.assigning)
    slot = slots[int(work.assigning[0, 0])]
    way = target + slot * frame
    d = length(way)
    out.slot_near, out.slot_far, out.slot_away = _soft(way, _NEAR), _soft(way, _FAR), d / (d + ONE)
    out.target, out.target_velocity, out.known = _soft(target, ONE), velocity, ONE
    # The slot law: the slot's velocity plus a velocity towards it, proportional to the distance.
    wish = slot_velocity(velocity, rate, slot * frame) + scaled(way, _GAIN)
    wanted = length(wish)
    out.law_speed, out.law_direction = min(wanted / top, ONE), _soft(wish, _SMALL)
    out.law_turn = _turn_to(wish, row, f)


@compiled
def _estimate(
    row: FloatArray, f: Record, theta: complex, speed: Any, share: np.float32, old: Record
) -> tuple[complex, complex]:
    """Return the target's velocity and position, averages of its fix and the old estimate, and remember them.

    A share of 1 takes the fix as it is.
    """
    step: Any = row[f.control_step]
    averages, is_new = share < ONE and old.age >= ZERO, row[f.target_age] < old.age + HALF * step
    if averages and old.speed > ZERO:
        measures = is_new and length(pair(row, f.target_velocity)) > ZERO  # a fix after a silence has no velocity
        change: Any = share if measures else ZERO
        speed = old.speed + change * (speed - old.speed)
    velocity = scaled(theta, speed)
    target = scaled(pair(row, f.target_bearing), row[f.target_range])
    target += scaled(velocity, min(row[f.target_age], _OLDEST))
    position, heading = pair(row, f.position), pair(row, f.heading)
    if averages:
        guess = (old.place - position) * heading.conjugate() + scaled(velocity, step)
        error = target - guess
        if length(error) < _JUMP:
            gain: Any = share if is_new else ZERO
            target = guess + scaled(error, gain)
    old.age, old.place, old.speed = row[f.target_age], position + target * heading, speed
    return velocity, target


@compiled
def _turn_to(way: complex, row: FloatArray, f: Record) -> Any:
    """Return the turn rate to a direction, as a share of the greatest."""
    return max(-ONE, min(_TURN_GAIN * angle_of(way) / row[f.max_turn_rate], ONE))


@compiled
def _frame_limit(known: Known, speed: Any) -> Any:
    """Return how fast (rad/s) the slot frame of a target turns at most: the outermost slot outruns no tracker."""
    outermost: Any = _SMALL
    for s in range(len(known.slots)):
        outermost = max(outermost, length(known.slots[s]))
    return max(ZERO, min(_FRAME_SHARE * (known.slowest - speed), speed)) / outermost


@compiled
def _watch_frame(row: FloatArray, known: Known, old: Record) -> tuple[complex, complex, Any]:
    """Return the headings of the target and of the slot frame, and how fast the frame turns (rad/s).

    It turns to the target's heading at a limited rate, also after the fix: a faster turn is noise of both headings.
    """
    f = known.at[0]
    v = length(pair(row, f.target_velocity))
    most = _frame_limit(known, v)
    step, age = row[f.control_step], row[f.target_age]
    theta, frame, heading = pair(row, f.target_heading), pair(row, f.target_frame), pair(row, f.heading)
    if known.trust < ONE and old.age >= ZERO:
        before, since = old.frame * heading.conjugate(), max(ZERO, old.age + step - age)  # s, between the fixes
        reach: Any = _frame_limit(known, max(v, old.speed)) * since  # a fix after a silence has no velocity
        gain: Any = known.trust if since > HALF * step else ZERO
        turn = clip(angle_of(theta * before.conjugate()), -reach, reach)
        error = angle_of(frame * (before * complex(math.cos(turn), math.sin(turn))).conjugate())
        back: Any = (gain - ONE) * error
        noise = complex(math.cos(back), math.sin(back))
        theta, frame = theta * noise, frame * noise
    old.frame = frame * heading
    behind = angle_of(theta * frame.conjugate())
    turn = clip(behind, -most * age, most * age)
    return theta, frame * complex(math.cos(turn), math.sin(turn)), clip((behind - turn) / step, -most, most)


@compiled
def _explore(row: FloatArray, known: Known, mates: Places) -> complex:
    """Return the direction in which a tracker explores: ahead, away from team-mates and from walls."""
    f, way = known.at[0], complex(1.0, 0.0)
    for j in range(len(mates)):
        way += push_from(mates[j], _SPREAD)
    inwards = push_inwards(pair(row, f.position), scaled(known.half, 0.5))
    return _soft(way + inwards * pair(row, f.heading).conjugate(), _SMALL)


@compiled
def _is_outside(row: FloatArray, known: Known, place: complex) -> bool:
    """Return whether a robot at a place would touch a wall."""
    f, half = known.at[0], known.half
    at, radius = pair(row, f.position) + place * pair(row, f.heading), row[f.robot_radius]
    return bool(abs(at.real) > half.real - radius or abs(at.imag) > half.imag - radius)


@compiled
def _soft(v: complex, scale: np.float32) -> complex:
    """Return a vector whose length d is scaled to d / (d + scale)."""
    far = length(v) + scale
    return complex(v.real / far, v.imag / far)


@compiled
def _gather_team(row: FloatArray, known: Known, mates: Records, places: Places) -> tuple[int, int]:
    """Write the present positions (m) of the known team, own robot first; return how many, and how many of them work.

    Robots silent for longer than the ``patience`` (s) are taken for broken, and come last.
    """
    f = known.at[0]
    places[0], count, working = 0j, 1, 1
    for silent in (False, True):
        for p in range(f.neighbours):
            place = p * f.stride
            age, number = row[f.neighbour_age + place], int(row[f.neighbour_number + place])
            if number >= 0 and (age > known.patience) == silent and count < MOST:
                way = scaled(pair(row, f.neighbour_bearing + place), row[f.neighbour_range + place])
                heading = pair(row, f.neighbour_heading + place)
                if number < len(mates):
                    way += scaled(mates[number].shift * pair(row, f.heading).conjugate(), known.unit)
                    heading *= complex(math.cos(mates[number].twist), math.sin(mates[number].twist))
                run: Any = row[f.neighbour_speed + place] * min(age, _OLDEST)
                places[count] = way + scaled(heading, run)
                count += 1
        if not silent:
            working = count
    return count, working
