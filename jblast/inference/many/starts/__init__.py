"""Where the searches of a batch begin."""
