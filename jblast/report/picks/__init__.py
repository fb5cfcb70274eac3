"""What was picked of records: words, JSON, pictures, page, files."""
