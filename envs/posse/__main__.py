"""``python -m posse``: the command line, as ``posse``."""

import importlib
import sys

if __name__ == "__main__":
    sys.exit(importlib.import_module("posse_training.cli").main())
