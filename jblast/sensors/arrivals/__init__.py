"""What comes to a place: every wave of every charge, and the pressure of them all."""
