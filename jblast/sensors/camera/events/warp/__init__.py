"""Event pixels as Warp kernels, for a GPU."""
