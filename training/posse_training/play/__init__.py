"""``posse play``: a person drives the target, or one of the trackers."""

import os

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
