"""What would be recorded, filmed and flown through."""
