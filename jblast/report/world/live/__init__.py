"""A world in a window, as its clock passes."""
