"""What the laws say, and how well a method does."""
