"""Runs of a world in the formats of viewers and robots."""
