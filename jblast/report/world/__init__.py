"""Random blasts and who perceived them, as documents, tables and text."""
