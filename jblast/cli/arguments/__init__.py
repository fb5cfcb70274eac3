"""What the words on a command line mean: numbers, laws, logs, files."""
