"""Charts of speed against accuracy: figure and table."""
