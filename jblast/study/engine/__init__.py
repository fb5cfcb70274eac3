"""The engine of a study: tiles, devices, stores, summaries and their merging."""
