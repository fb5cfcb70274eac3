"""Weak shocks far away: the tail, its ISO 9613-1 absorption, its pressure."""
