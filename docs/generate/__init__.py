"""What of the manual is generated: from parsers, tables, docstrings, kept results."""
