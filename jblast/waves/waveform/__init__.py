"""Pressure against time at a place: Friedlander, finite rise, negative phase."""
