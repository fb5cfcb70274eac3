"""The inertial measurement unit of a vehicle: what it reads, and what a jolt leaves."""
