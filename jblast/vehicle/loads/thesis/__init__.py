"""Loads of a blast as Parab's thesis prints them, and as its plugin gives them."""
