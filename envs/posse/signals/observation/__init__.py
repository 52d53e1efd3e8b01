"""Observations: declared fields, and how they are written to the rows of a batch."""
