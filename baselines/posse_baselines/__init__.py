"""Policies that play without torch: scripted ones and shipped learned ones."""

from posse_baselines.ddcs import DDCS
from posse_baselines.deploy import deploy
from posse_baselines.fields import Tunable, tunables
from posse_baselines.playing import Recorder, Trajectory, batch_for, play, rollout
from posse_baselines.policy import (
    BasePolicy,
    Memory,
    Policy,
    PolicyError,
    begin,
    from_function,
    split_agents,
    stack_agents,
)
from posse_baselines.registry import Target, load, load_target, policy_names, target_names
from posse_baselines.safeguard import Safeguard
from posse_baselines.tracker_env import register

register()

__all__ = [
    "DDCS",
    "BasePolicy",
    "Memory",
    "Policy",
    "PolicyError",
    "Recorder",
    "Safeguard",
    "Target",
    "Trajectory",
    "Tunable",
    "batch_for",
    "begin",
    "deploy",
    "from_function",
    "load",
    "load_target",
    "play",
    "policy_names",
    "rollout",
    "split_agents",
    "stack_agents",
    "target_names",
    "tunables",
]
