"""Gauges that write down pressure, wind and the motion of the ground over time."""
