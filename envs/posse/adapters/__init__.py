"""The engine as Gymnasium and PettingZoo environments."""

from posse.engine.arguments import check_seed, options_of, real_numbers

__all__ = ["check_seed", "options_of", "real_numbers"]
