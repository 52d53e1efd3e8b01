"""Robots of the Robotarium's simulator form up on a sixth, 20 times.

python robotarium.py [policy [lag of the wheels in s, delay of the commands in steps of 0.1 s]]
"""

import sys

import numpy as np
from rps.robotarium import Robotarium
from scipy.optimize import linear_sum_assignment

import posse
from posse_baselines import deploy, load

policy = load(sys.argv[1] if len(sys.argv) > 1 else "pngl-l-phi")
lag, delay = (float(sys.argv[2]), int(sys.argv[3])) if len(sys.argv) > 2 else (0.0, 0)
follows = 1 - np.exp(-0.033 / lag) if lag else 1.0  # share of a wanted change that a step of the simulator brings
scale, n = 0.15 / 0.055, 5  # these robots have a radius of 0.055 m, those of a scenario 0.15 m
robots = {"tracker_speed": 0.13 * scale, "tracker_turn_rate": 1.3, "target_speed": 0.04 * scale}
sizes = {"formation_distance": 0.8, "formation_spacing": 0.8, "tolerance": 0.14, "message_size": policy.message_size}
late = {"actuator_lag": lag, "command_delay": delay}
scenario = posse.get_scenario("constant", control_step=0.099, physics_step=0.033, **robots, **sizes, **late)
settled = clean = 0
for seed in range(20):
    place = np.random.default_rng(seed).permutation(28)[:n]
    start = np.vstack([(place % 7) * 0.4 - 1.2, place // 7 * 0.4 - 0.6, place * 1.0])
    arena = Robotarium(n + 1, False, False, np.column_stack([start, (-0.6, 0.0, 0.0)]))
    team = [deploy(policy, posse.Robot(scenario, i, scale=scale)) for i in range(n)]
    said, errors, moving = [()] * n, [], np.zeros((2, n + 1))
    moving[:, n] = 0.04, 0.0  # the target
    waiting = [moving.copy() for _ in range(delay + 1)]
    for step in range(1200):
        poses = arena.get_poses().copy()
        if step % 3 == 0:  # a control step is three of the simulator's
            commands = moving.copy()
            heard = [posse.Heard(i, *poses[:, i], *moving[:, i], said[i]) for i in range(n)]
            for i, robot in enumerate(team):
                mates = [message for message in heard if message.number != i]
                command = robot.step(poses[:, i], *moving[:, i], posse.TargetFix(*poses[:, n]), None, mates)
                commands[:, i], said[i] = command[:2], command.message
            waiting = [*waiting[1:], commands]
        moving += follows * (waiting[0] - moving)
        arena.set_velocities(range(n + 1), moving.copy())
        arena.step()
        c, s = np.cos(poses[2, n]), np.sin(poses[2, n])
        slots = np.array(scenario.slot_offsets) / scale @ [[c, s], [-s, c]] + poses[:2, n]
        gaps = np.linalg.norm(poses[:2, :n].T[:, None] - slots, axis=2)
        errors.append(gaps[linear_sum_assignment(gaps)].max())
    settled += max(errors[-90:]) < 0.01  # m, in the last three seconds
    clean += not arena._errors  # the simulator's own check of collisions, boundary and wheels
    arena._errors.clear()
    print(f"start {seed}: slot error {1000 * max(errors[-90:]):.1f} mm")
print(f"{settled} of 20 settled within 10 mm, {clean} without a fault")
