"""What is said of vehicles that others fly, or watch, over MAVLink."""
