"""Policies on the same worlds: played, estimated, drawn."""
