"""Dynamics, contacts, sensing, radio and scoring of one world."""
