"""A discovered law, in words and as a figure."""
