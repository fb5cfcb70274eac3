"""Gains tuned by gradient through blasts, as text, figure, JSON and a scene file."""
