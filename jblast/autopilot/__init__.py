"""Estimators, autopilots and ground stations of a vehicle, and its flight logs."""
