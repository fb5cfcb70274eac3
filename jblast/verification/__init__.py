"""Cases with a known truth: films, recordings and posteriors."""
