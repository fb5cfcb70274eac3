"""Outcomes of a sample of a study; each is registered once."""
