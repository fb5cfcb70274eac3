"""What a planned log would tell, in words and as a map."""
