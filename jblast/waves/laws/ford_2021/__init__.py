"""Ford et al. (2021): chemical explosions near the ground, buried or raised."""
