"""Replays: one or more teams on the same world, as one HTML file."""

from posse_training.replay.episode import Event, Player, Replay, join
from posse_training.replay.page import read_replay, write_replay
from posse_training.replay.recording import RECORD, record, replay_of

__all__ = ["RECORD", "Event", "Player", "Replay", "join", "read_replay", "record", "replay_of", "write_replay"]
