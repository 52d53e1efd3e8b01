"""Settings of every process that runs tests, made before any library is imported."""

import os

# Small networks do not gain from torch's threads, which wait for each other by spinning.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# Windows of tests need no screen.
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
