"""A vehicle as a ground station knows one: telemetry, missions, commands."""
