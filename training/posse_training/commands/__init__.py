"""The commands ``train``, ``watch``, ``export`` and ``scenarios``."""
