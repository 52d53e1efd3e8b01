"""The commands ``train``, ``watch``, ``replay``, ``export``, ``scenarios`` and ``policies``."""
