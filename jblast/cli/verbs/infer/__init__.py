"""What a blast was, and what could be told."""
