"""Flights as commands ask for and write them."""
