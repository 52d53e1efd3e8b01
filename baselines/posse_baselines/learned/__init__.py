"""Learned policies: neural networks stored as plain numbers, played without torch."""

from posse_baselines.learned.inputs import Encoder, Encoding
from posse_baselines.learned.network import Network
from posse_baselines.learned.policy import LearnedPolicy

__all__ = ["Encoder", "Encoding", "LearnedPolicy", "Network"]
