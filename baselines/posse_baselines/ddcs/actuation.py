"""The actuation layer around the safeguard: what is near, ways past it, and commands that are carried out late."""

import math
from typing import Final

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.memory import Team, pair, since
from posse_baselines.ddcs.settings import FLOCKING
from posse_baselines.laws.geometry import clip, cross, dot, length, scaled, unit, vector
from posse_baselines.laws.guidance import regulate, write_motion
from posse_baselines.laws.safeguard import MOST_TURN, WALLS, put_disc, put_walls, safe_velocity, to_wall, turn_past

_EXPLAINED: Final = 0.06  # m; an echo this near to the expected one needs no other explanation
_MOST_AGE: Final = 0.7  # s; of a message, up to which the margin of its sender grows
_SIDE_KEPT: Final = 1.5  # s


@compiled
def is_explained(team: Team, me: Record, robots: Records, beam: complex, reading: float) -> bool:
    """Return whether one of the known robots (discs), or a wall, explains a sonar reading (m) along a beam."""
    world, radius, wide_beam = team.world, float(team.world.radius), float(team.world.wide_beam)
    reach = reading + 2.0 * radius + _EXPLAINED
    for j in range(len(robots)):
        place = robots[j].place
        square = dot(place, place)
        if square > reach * reach:
            continue
        # A little wider than beam and disc, since the position is not exact.
        along = dot(place, beam)
        if along >= wide_beam * math.sqrt(square) or (along > 0.0 and abs(cross(place, beam)) < radius + 0.1):
            return True
    for k in range(4):
        away, towards = to_wall(world, k, me.position), dot(WALLS[k], beam)
        if towards > 0.0 and reading >= away / towards - radius - _EXPLAINED:
            return True
    return False


@compiled
def surround(team: Team, me: Record, mates: Records, row: FloatArray, discs: Records) -> int:
    """List the discs that will be near when the command is executed, unexplained echoes last; return their number.

    With a command delay, echoes are placed relative to the foreseen pose, though measured at the observed one: teams
    scored more with that.
    """
    at, world, settings = team.at, team.world, team.settings
    count, two, radius = 0, 2.0 * world.radius, float(world.radius)
    if me.known:
        # In a chase the target is not avoided: the law ends the chase in time.
        reach, margin = (0.0, 0.0) if me.closing else (two, float(settings.target_margin))
        way = me.target - me.position
        count = put_disc(discs, count, way, me.target_velocity, reach, margin)
        if count > 0 and world.target_turns > 0.0:
            for turn in (-world.target_turns, world.target_turns):
                count = put_disc(discs, count, way, me.target_velocity, reach, margin)
                discs[count - 1].turn = turn
    for j in range(len(mates)):
        mate = mates[j]
        if mate.step < 0:
            continue
        age = since(team, me, mate.step)
        way, velocity = mate.place - me.position, complex(mate.velocity) if age <= world.patience else 0j
        # If it were still there after a silence, it would have a place in the observation.
        if not (world.unlisted and age > world.patience and length(way) < me.horizon):
            margin = settings.margin + settings.age_margin * min(age, _MOST_AGE)
            count = put_disc(discs, count, way, velocity, two, margin)
    robots = count
    count = put_walls(discs, count, world, me.position, world.radius, settings.margin)
    heading = pair(row, at.heading)  # at which the sonar measured
    course = complex(me.target_velocity) if me.known and world.strangers else 0j  # a team-mate moves with the target
    for k in range(at.sonar_beams):
        reading = float(row[at.sonar + k])
        beam = team.beams[k] * heading
        if reading >= world.sonar_range - _EXPLAINED or is_explained(team, me, discs[:robots], beam, reading):
            continue
        # Its position within the beam is unknown: a disc that fills most of the beam.
        wide = min(0.5, 0.4 * (reading + radius))
        place = scaled(beam, reading + radius + wide)
        count = put_disc(discs, count, place, course, wide + radius, settings.echo_margin)
    return count


@compiled
def detour(team: Team, me: Record, discs: Records, wanted: complex) -> complex:
    """Return the wanted velocity (m/s), turned to the edge of what stands in its way; a side once taken is kept.

    The safeguard looks 1.5 s ahead: in front of a wide obstacle no small change of direction helps, and it slows down.
    """
    ahead, clearance = unit(wanted), team.settings.detour
    left = turn_past(discs, clearance, ahead, 1.0)
    if left == 0.0:  # nothing stands in the way
        return wanted
    right = turn_past(discs, clearance, ahead, -1.0)
    kept = me.side if since(team, me, me.side_step) <= _SIDE_KEPT else 0
    goes_left = abs(left) < abs(right)
    if kept != 0 and abs(left if kept > 0 else right) <= MOST_TURN:
        goes_left = kept > 0
    turn = left if goes_left else right
    if abs(turn) > MOST_TURN:
        return wanted
    me.side, me.side_step = 1 if goes_left else -1, me.step
    return wanted * vector(1.0, turn)


@compiled
def execute_safely(team: Team, me: Record, discs: Records, action: FloatArray) -> None:
    """Write the command for the wanted velocity, past what stands in its way and made safe, into an action.

    It is the command of the law, if the velocity stays the wanted one.
    """
    speed, omega, velocity = me.wish_speed, me.wish_omega, me.wish
    if team.settings.detour > 0.0 and me.task != FLOCKING:
        velocity = detour(team, me, discs, velocity)
    velocity, evades = safe_velocity(me, discs, velocity)
    if evades or velocity != me.wish:
        speed, omega = regulate(me, velocity)
    # Made up for the lag, and remembered until it is executed.
    more, delay = 1.0 / team.world.followed - 1.0, int(team.world.delay)
    speed += more * (speed - me.speed)
    omega += more * (omega - me.omega)
    if delay > 0:
        kept = complex(clip(speed, 0.0, me.max_speed), clip(omega, -me.max_omega, me.max_omega))
        me.waiting[me.step % delay] = kept
    write_motion(me, speed, omega, action)
    me.step += 1


@compiled
def correct(me: Record, correction: complex) -> None:
    """Add to the wanted velocity, ahead and to the left, in shares of the greatest speed, which also limits the sum.

    The command changes by what regulation of the two velocities differs by, so that a small
    correction changes little, whatever law the command came from.
    """
    if correction == 0j:
        return
    wish = me.wish + scaled(correction * me.heading, me.max_speed)
    excess = max(1.0, length(wish) / max(me.max_speed, length(me.wish)))
    wish = scaled(wish, 1.0 / excess)
    old_speed, old_omega = regulate(me, me.wish)
    speed, omega = regulate(me, wish)
    me.wish = wish
    me.wish_speed += speed - old_speed
    me.wish_omega += omega - old_omega
