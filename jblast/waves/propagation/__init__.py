"""What the way does to a wave: air, wind, spreading, absorption."""
