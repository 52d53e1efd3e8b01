"""numba's compiler passes and the kernel cache; not needed to change a rule."""
