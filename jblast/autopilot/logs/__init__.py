"""Flights as ground stations and autopilots keep them: .tlog and PX4's ULog."""
