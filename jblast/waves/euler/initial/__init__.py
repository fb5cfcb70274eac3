"""How a run of the shock solver begins."""
