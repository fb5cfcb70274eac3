"""A choice of method: why it was taken, on a terminal and for a program."""
