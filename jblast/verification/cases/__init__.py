"""Cases that charts and benchmarks share."""
