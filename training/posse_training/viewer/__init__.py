"""The window of ``posse watch``: one world played by policies; state, time and drawing apart."""

import os

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
