"""The point source: front, pressure and arrival from Euler runs."""
