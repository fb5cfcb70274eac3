"""The map of failures, its panels and its words."""
