"""Batches of worlds: kernels, and the classes that call them."""
