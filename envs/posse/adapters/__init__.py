"""The engine as Gymnasium and PettingZoo environments."""
