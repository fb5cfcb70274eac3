"""Loads on a vehicle: blasts, pulses, gusts."""
