"""What is kept of a study whose samples are too many to keep: statistics of tiles."""
