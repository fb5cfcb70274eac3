"""What is said of a log before it is fitted."""
