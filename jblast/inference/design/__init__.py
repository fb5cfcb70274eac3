"""What a planned log would tell: Cramer-Rao bounds, sensor maps, the datum to add."""
