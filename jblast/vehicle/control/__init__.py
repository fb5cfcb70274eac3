"""What holds a vehicle in its place: gains, thrust, allocation to rotors."""
