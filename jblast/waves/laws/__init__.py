"""Published laws, one source a file or folder."""
