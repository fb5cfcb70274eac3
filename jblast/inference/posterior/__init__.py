"""The log-density of a scene's numbers given a log: prior, likelihood, information."""
