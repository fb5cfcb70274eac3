"""Scene files, read and checked key by key."""
