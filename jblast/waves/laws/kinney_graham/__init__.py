"""Kinney and Graham (1985): chemical and nuclear explosions in free air."""
