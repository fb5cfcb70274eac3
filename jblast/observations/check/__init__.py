"""What is odd about a log, told without any physics."""
