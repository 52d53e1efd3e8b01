"""The commands ``train``, ``watch``, ``play`` and ``scenarios``."""
