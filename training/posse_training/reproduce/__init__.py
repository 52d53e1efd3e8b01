"""The paper's section 4: ``posse reproduce``."""
