"""Commands that are not reports: ``posse train``, ``posse watch`` and ``posse scenarios``."""
