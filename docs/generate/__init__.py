"""Generated parts of the manual: from parsers, tables, docstrings and results."""
