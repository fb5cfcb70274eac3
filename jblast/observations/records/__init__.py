"""Records of samples: one module a file format, and the positions of recorders."""
