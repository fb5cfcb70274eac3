"""Vehicles over MAVLink, as commands ask for them."""
