"""Where fits and walks fail: starts, ridges, modes, outliers."""
