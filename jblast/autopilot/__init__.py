"""Who flies a vehicle in place of what it truly does: estimates, autopilots, logs."""
