"""Worlds by the thousand: kernels, and the batch that calls them."""
