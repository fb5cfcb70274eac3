"""Equations of motion found in recorded trajectories, with their uncertainty."""
