"""Explosion sets: pictures of heat, soot and dust, lit and scaled by the laws."""
