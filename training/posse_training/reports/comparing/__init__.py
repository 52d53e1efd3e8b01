"""``posse compare``: contenders on the same worlds, their results, and a comparison's folder."""
