"""What was heard in a recording: words, JSON, picture, files."""
