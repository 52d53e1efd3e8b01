"""Robots of the Robotarium's simulator form up on a sixth, 20 times.

python robotarium.py [policy [lag delay]]: the lag of the wheels in s,
the delay of the commands in steps of 0.1 s
"""

import sys

import numpy as np
from rps.robotarium import Robotarium
from scipy.optimize import linear_sum_assignment

import posse
from posse_baselines import deploy, load

policy = load(sys.argv[1] if len(sys.argv) > 1 else "pngl-l-phi")
late = len(sys.argv) > 2
lag, delay = (
    (float(sys.argv[2]), int(sys.argv[3])) if late else (0.0, 0)
)
# The share of a wanted change that a step of the simulator brings.
follows = 1 - np.exp(-0.033 / lag) if lag else 1.0
scale, n = 0.15 / 0.055, 5  # radius of a scenario's robot, of these, m
scenario = posse.get_scenario(
    "constant",
    control_step=0.099,
    physics_step=0.033,
    tracker_speed=0.13 * scale,
    tracker_turn_rate=1.3,
    target_speed=0.04 * scale,
    formation_distance=0.8,
    formation_spacing=0.8,
    tolerance=0.14,
    message_size=policy.message_size,
    actuator_lag=lag,
    command_delay=delay,
)
settled = clean = 0
for seed in range(20):
    place = np.random.default_rng(seed).permutation(28)[:n]
    x, y = place % 7 * 0.4 - 1.2, place // 7 * 0.4 - 0.6
    start = np.column_stack([(x, y, place * 1.0), (-0.6, 0.0, 0.0)])
    arena = Robotarium(n + 1, False, False, start)
    robots = [posse.Robot(scenario, i, scale=scale) for i in range(n)]
    team = [deploy(policy, robot) for robot in robots]
    said, errors, moving = [()] * n, [], np.zeros((2, n + 1))
    moving[:, n] = 0.04, 0.0  # the target
    waiting = [moving.copy() for _ in range(delay + 1)]
    for step in range(1200):
        poses = arena.get_poses().copy()
        if step % 3 == 0:  # a control step is three of the simulator's
            commands = moving.copy()
            fix = posse.TargetFix(*poses[:, n])
            own = [(*poses[:, i], *moving[:, i]) for i in range(n)]
            heard = [posse.Heard(i, *own[i], said[i]) for i in range(n)]
            for i, robot in enumerate(team):
                mates = heard[:i] + heard[i + 1 :]
                pose, speeds = own[i][:3], own[i][3:]
                command = robot.step(pose, *speeds, fix, None, mates)
                commands[:, i], said[i] = command[:2], command.message
            waiting = [*waiting[1:], commands]
        moving += follows * (waiting[0] - moving)
        arena.set_velocities(range(n + 1), moving.copy())
        arena.step()
        c, s = np.cos(poses[2, n]), np.sin(poses[2, n])
        slots = np.array(scenario.slot_offsets) @ [[c, s], [-s, c]]
        slots = slots / scale + poses[:2, n]
        offsets = poses[:2, :n].T[:, None] - slots
        gaps = np.linalg.norm(offsets, axis=2)
        errors.append(gaps[linear_sum_assignment(gaps)].max())
    settled += max(errors[-90:]) < 0.01  # m, in the last three seconds
    clean += not arena._errors  # collisions, boundary, wheels
    arena._errors.clear()
    print(f"start {seed}: slot error {1000 * max(errors[-90:]):.1f} mm")
print(f"{settled} of 20 settled within 10 mm, {clean} without a fault")
