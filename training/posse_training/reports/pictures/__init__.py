"""Figures of a comparison, and films."""
