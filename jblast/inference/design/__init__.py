"""Design of layouts: Cramer-Rao bounds, sensor maps, the datum to add."""
