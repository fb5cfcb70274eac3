"""The same flight in Warp: whole rollouts in registers."""
