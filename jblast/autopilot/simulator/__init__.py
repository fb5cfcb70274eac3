"""A simulator as PX4 knows one: sensors out, rotors' controls in, in lockstep."""
