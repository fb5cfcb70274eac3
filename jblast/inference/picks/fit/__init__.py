"""The fit: model, optimum, posterior, of some records at once."""
