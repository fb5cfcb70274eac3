"""Places on the Earth: latitudes and longitudes as east, north, up, and back."""
