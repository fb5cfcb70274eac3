"""Jump conditions across a shock, and its reflection."""
