"""What a tuning is asked of the command line."""
