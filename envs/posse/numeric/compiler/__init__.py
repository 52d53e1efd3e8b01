"""numba's options, passes and cache: nothing to know of to change a rule."""
