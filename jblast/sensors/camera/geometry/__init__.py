"""Lens and pose: from a place to a pixel, and back to a ray."""
