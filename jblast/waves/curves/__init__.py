"""Fitted and tabulated curves over scaled distance, with slopes and tails."""
