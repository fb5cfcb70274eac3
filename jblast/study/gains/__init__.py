"""Gains of a position hold tuned by gradient through a scene's blasts."""
