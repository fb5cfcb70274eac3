"""Samples of a study: keys, draws, outcomes and the run."""
