"""One place asked for its quantities, forward or backward."""
