"""Settings of every process that runs tests, made before any library of numbers or windows is imported."""

import os

from hypothesis import settings

# Small networks do not gain from torch's threads, which wait for each other by spinning.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# With colorama, numba prepares the colours of messages that it never shows: some percent of the time to compile.
os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")
# Windows of tests need no screen; what commands print is compared in 80 columns and without colours.
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.update(COLUMNS="80", NO_COLOR="1")
os.environ.pop("FORCE_COLOR", None)
# Properties are tried on the same examples in every run, and however long one takes.
settings.load_profile("ci")
