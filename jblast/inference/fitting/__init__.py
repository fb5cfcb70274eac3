"""The fit of one log: solve, judge, warn, and put the answer together."""
