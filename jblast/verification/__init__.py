"""How well jblast does it: what `jblast chart` and `jblast stability` measure."""
