"""Sensors that a vehicle flies by: inertial, of air, satellites and field."""
