"""The windows of ``posse watch``: one world, played by policies, looked at closely."""

import os

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
