"""What a vehicle knows of its own state: a filter of what its instruments say."""
