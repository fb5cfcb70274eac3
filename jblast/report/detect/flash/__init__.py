"""What was seen in a film: words, JSON, picture, files."""
