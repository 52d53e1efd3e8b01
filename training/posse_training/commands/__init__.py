"""The commands ``posse train``, ``posse watch`` and ``posse scenarios``."""
