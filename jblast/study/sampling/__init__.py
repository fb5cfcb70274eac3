"""From a study to its samples: keys, draws, outcomes, the run."""
