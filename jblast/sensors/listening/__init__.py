"""What every sensor of a scene writes down over time, and the truth behind it."""
