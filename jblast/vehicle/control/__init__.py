"""Controllers of a vehicle: gains, pull, moment, allocation to rotors, stability."""
