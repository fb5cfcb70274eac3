"""Published laws, one source a file."""
