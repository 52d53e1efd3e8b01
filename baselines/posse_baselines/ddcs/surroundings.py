"""What is near a tracker, as discs: those it knows, and those that only the sonar tells of."""

from __future__ import annotations

import math

from posse.arrays import FloatArray, Record, Records
from posse.compiled import compiled
from posse_baselines.ddcs.monitoring import mate_now
from posse_baselines.safeguard import put_disc, put_wall

_NEAR = 3.0  # m; farther things are no danger yet
_EXPLAINED = 0.15  # m; an echo this near to the expected one needs no other explanation
_FORGOTTEN = 30.0  # s; where a team-mate that long silent stands is anybody's guess


@compiled
def expect_disc(
    f: Record, c: float, s: float, dx: float, dy: float, radius: float, echo: FloatArray
) -> None:
    """Lower the expected sonar readings (S,) by a disc that lies (dx, dy) away, common frame."""
    distance = math.hypot(dx, dy)
    if distance - radius - f.radius > f.sonar_range + 0.2:
        return
    ahead, left = dx * c + dy * s, dy * c - dx * s
    width = math.pi / f.sonar_beams
    for k in range(f.sonar_beams):
        angle = 2.0 * width * k
        ac, asn = math.cos(angle), math.sin(angle)
        along, across = ahead * ac + left * asn, left * ac - ahead * asn
        # A little wider than the beam, since the place is not known exactly.
        if along >= math.cos(width * 1.3) * distance or (along > 0.0 and abs(across) < radius + 0.1):
            echo[k] = min(echo[k], distance - radius - f.radius)


@compiled
def surround(
    f: Record,
    s: Record,
    d: Record,
    mates: Records,
    own: int,
    x: float,
    y: float,
    theta: float,
    o: FloatArray,
    echo: FloatArray,
    discs: Records,
) -> int:
    """List what is near the tracker; return how many things that are. ``echo`` (S,) is work space."""
    c, sn = math.cos(theta), math.sin(theta)
    for k in range(f.sonar_beams):
        echo[k] = f.sonar_range
    count, two, radius = 0, 2.0 * f.radius, float(f.radius)
    if d.known:
        dx, dy = d.now_x - x, d.now_y - y
        if dx * dx + dy * dy < _NEAR * _NEAR:
            vx, vy = d.speed * math.cos(d.now_theta), d.speed * math.sin(d.now_theta)
            count = put_disc(discs, count, dx, dy, vx, vy, two, s.target_margin)
            expect_disc(f, c, sn, dx, dy, radius, echo)
    for j in range(len(mates)):
        mate = mates[j]
        if j == own or mate.step < 0 or (d.step - mate.step) * f.dt > _FORGOTTEN:
            continue
        mx, my = mate_now(f, s, d, mate)
        dx, dy = mx - x, my - y
        if dx * dx + dy * dy < _NEAR * _NEAR:
            vx, vy = float(mate.speed_x), float(mate.speed_y)
            if (d.step - mate.step) * f.dt > s.lost_after:
                vx, vy = 0.0, 0.0
            count = put_disc(discs, count, dx, dy, vx, vy, two, s.margin)
            expect_disc(f, c, sn, dx, dy, radius, echo)
    if f.walled:
        half = float(f.extent)
        count = add_wall(f, s, c, sn, half - x, 1.0, 0.0, count, echo, discs)
        count = add_wall(f, s, c, sn, half + x, -1.0, 0.0, count, echo, discs)
        count = add_wall(f, s, c, sn, half - y, 0.0, 1.0, count, echo, discs)
        count = add_wall(f, s, c, sn, half + y, 0.0, -1.0, count, echo, discs)
    for k in range(f.sonar_beams):
        reading = float(o[f.sonar + k])
        if reading < f.sonar_range - 1e-3 and reading < echo[k] - _EXPLAINED:
            # It may lie anywhere in the beam's width: a disc that fills most of it.
            wide = min(0.5, 0.4 * (reading + radius))
            angle = theta + 2.0 * math.pi * k / f.sonar_beams
            away = reading + radius + wide
            count = put_disc(
                discs, count, away * math.cos(angle), away * math.sin(angle), 0.0, 0.0,
                wide + radius, s.echo_margin,
            )  # fmt: skip
    return count


@compiled
def add_wall(
    f: Record,
    s: Record,
    c: float,
    sn: float,
    distance: float,
    normal_x: float,
    normal_y: float,
    count: int,
    echo: FloatArray,
    discs: Records,
) -> int:
    """Add a wall to the discs and to the expected echoes, if it is near."""
    if distance > _NEAR:
        return count
    ahead, left = normal_x * c + normal_y * sn, normal_y * c - normal_x * sn
    width = math.pi / f.sonar_beams
    for k in range(f.sonar_beams):
        towards = ahead * math.cos(2.0 * width * k) + left * math.sin(2.0 * width * k)
        if towards >= math.cos(width * 1.1):
            echo[k] = min(echo[k], distance - f.radius)
        elif towards > 0.0:
            echo[k] = min(echo[k], distance / towards - f.radius)
    return put_wall(discs, count, distance, normal_x, normal_y, f.radius, s.margin)
