"""Policies that ship with the package: chosen, saved with a card, and checked."""
