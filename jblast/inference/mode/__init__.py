"""The optima of a posterior: starts, search, and the normal around each."""
