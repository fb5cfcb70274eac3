"""Measured cost, error and failure modes: `jblast chart` and `jblast stability`."""
