"""Loads from a table of one's own: an impulse profile, its file, its lever."""
