"""One page of a world: a map, every sense on one time axis, tables."""
