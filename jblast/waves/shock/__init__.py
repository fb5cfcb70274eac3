"""Jump conditions across a shock, its reflection, and its decay far away."""
