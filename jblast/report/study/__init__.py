"""What studies came to: the text of a run, its JSON, and pages."""
