"""Many times over: what methods cost, how far they are off, where they break."""
