"""What a front's speed tells: arrival and pressure of one Mach number."""
