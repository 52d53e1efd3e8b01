"""Robots of the Robotarium's simulator form up on a sixth, 20 times: python robotarium.py [policy]."""

import sys

import numpy as np
from rps.robotarium import Robotarium
from scipy.optimize import linear_sum_assignment

import posse
from posse_baselines import deploy, load

policy = load(sys.argv[1] if len(sys.argv) > 1 else "pngl-l-phi")
scale, n = 0.15 / 0.055, 5  # these robots have a radius of 0.055 m, those of a scenario 0.15 m
robots = {"tracker_speed": 0.13 * scale, "tracker_turn_rate": 1.3, "target_speed": 0.04 * scale}
sizes = {"formation_distance": 0.8, "formation_spacing": 0.8, "tolerance": 0.14, "message_size": policy.message_size}
scenario = posse.get_scenario("constant", control_step=0.099, physics_step=0.033, **robots, **sizes)
settled = clean = 0
for seed in range(20):
    place = np.random.default_rng(seed).permutation(28)[:n]
    start = np.vstack([(place % 7) * 0.4 - 1.2, place // 7 * 0.4 - 0.6, place * 1.0])
    arena = Robotarium(n + 1, False, False, np.column_stack([start, (-0.6, 0.0, 0.0)]))
    team = [deploy(policy, posse.Robot(scenario, i, scale=scale)) for i in range(n)]
    moving, said, errors = np.zeros((2, n + 1)), [()] * n, []
    for step in range(1200):
        poses = arena.get_poses().copy()
        if step % 3 == 0:  # a control step is three of the simulator's
            moving[:, n] = 0.04, 0.0
            heard = [posse.Heard(i, *poses[:, i], *moving[:, i], said[i]) for i in range(n)]
            for i, robot in enumerate(team):
                mates = [message for message in heard if message.number != i]
                command = robot.step(poses[:, i], *moving[:, i], posse.TargetFix(*poses[:, n]), None, mates)
                moving[:, i], said[i] = command[:2], command.message
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
