"""The commands ``train``, ``watch``, ``export``, ``scenarios`` and ``policies``."""
