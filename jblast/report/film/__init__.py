"""A film, and the events of a camera: what was written, for a program and in words."""
