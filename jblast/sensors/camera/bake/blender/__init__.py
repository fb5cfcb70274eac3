"""Scripts that Blender runs, in a Python that does not know jblast."""
