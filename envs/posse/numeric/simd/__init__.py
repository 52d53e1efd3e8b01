"""Blocks of eight numbers, and their compilation to vector instructions."""
