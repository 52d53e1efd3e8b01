"""Learning with TorchRL."""
