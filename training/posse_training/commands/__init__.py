"""The commands ``train``, ``watch``, ``scenarios`` and ``policies``."""
