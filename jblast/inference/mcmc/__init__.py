"""Walkers: ensemble moves, engines, convergence, checkpoints."""
