"""Ways to compute a world other than by jblast's own physics, as plain data."""
