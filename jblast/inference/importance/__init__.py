"""Draws weighted to the posterior: proposals, smoothed weights, interval checks."""
