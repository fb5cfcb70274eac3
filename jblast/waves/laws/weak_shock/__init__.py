"""Weak shocks far away: their pressure, and what the air absorbs by ISO 9613-1."""
