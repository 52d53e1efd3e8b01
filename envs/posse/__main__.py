"""``python -m posse``: the command line, as ``posse``."""

from __future__ import annotations

import importlib
import sys

if __name__ == "__main__":
    sys.exit(importlib.import_module("posse_training.cli").main())
