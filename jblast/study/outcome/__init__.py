"""What may be asked of a sample of a study; each outcome is registered once."""
