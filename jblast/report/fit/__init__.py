"""The answer of a fit: terminal, page, figures, files."""
