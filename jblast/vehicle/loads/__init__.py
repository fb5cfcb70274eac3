"""What pushes a vehicle besides its rotors."""
